"""What somebody showed elsewhere, as labels for a learner here: a log that a run goes on from."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from lira.fusion.log.label_log import Demonstration, DemonstrationLog
from lira.fusion.preprocess import Features
from lira.hal.errors import StorageError
from lira.hal.messages import Action, Driver
from lira.hal.profile import RobotProfile

NOTHING: Action = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Shown:
    """What was seen and done at one moment. `action` in fractions of the robot's limits; `source` says who did."""

    stamp_s: float
    episode: int
    features: Features
    action: Action
    source: str = Driver.HUMAN


@dataclass(slots=True)
class Tally:
    """How many were taken, and of how many the action was cut to what the robot can do."""

    taken: int = 0
    clipped: int = 0


def keep(shown: Iterable[Shown], path: Path, profile: RobotProfile, say: Callable[[str], None] = print) -> Tally:
    """Append to a log of labels, which need not be there yet. Raises `StorageError`, also if there was nothing."""
    tally = Tally()
    with DemonstrationLog(path, profile, say=say) as log:
        for number, each in enumerate(shown):
            action = _within(each.action)
            log.append(
                Demonstration(
                    each.stamp_s,
                    number,
                    each.episode,
                    each.source,
                    action,
                    NOTHING,
                    stored=True,
                    features=each.features,
                )
            )
            tally.taken += 1
            tally.clipped += action != each.action
    if not tally.taken:
        raise StorageError("there is nothing to learn from in it", "Is it the right file, and were all sensors there?")
    return tally


def _within(action: Action) -> Action:
    linear, angular = (min(1.0, max(-1.0, part)) for part in action)
    return linear, angular
