"""What somebody showed elsewhere, as labels for a learner here: a log that a run goes on from."""

import math
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

from lira.fusion.log.label_file import LIMIT
from lira.fusion.log.label_log import Demonstration, DemonstrationLog
from lira.fusion.preprocess import Features
from lira.hal.errors import StorageError
from lira.hal.messages import Action, Driver
from lira.hal.profile import RobotProfile

NOTHING: Action = (0.0, 0.0)
NAME_BYTES = 32  # of a driver in the log


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
    """How many were taken by source, of how many the action was cut to what the robot can do, how many had none."""

    taken: Counter[str] = field(default_factory=Counter)
    clipped: int = 0
    without: int = 0

    def is_usable(self, shown: Shown) -> bool:
        """Whether something was done; counts what was not."""
        done = all(map(math.isfinite, shown.action))
        self.without += not done
        return done


def keep(shown: Iterable[Shown], path: Path, profile: RobotProfile, say: Callable[[str], None] = print) -> Tally:
    """Append to a log of labels, which need not be there yet. Raises `StorageError`, also if there is nothing."""
    tally = Tally()
    usable = (each for each in shown if tally.is_usable(each))
    first = next(usable, None)  # before there is a log: for nothing, none is begun
    if first is None:
        raise StorageError("there is nothing to learn from in it", "Is it the right file, and were all sensors there?")
    with DemonstrationLog(path, profile, say=say) as log:
        for number, each in enumerate(chain([first], usable)):
            label = _label(number, each)
            log.append(label)
            tally.taken[label.source] += 1
            tally.clipped += _within(each.action) != each.action
    return tally


def _label(number: int, shown: Shown) -> Demonstration:
    for name, array in shown.features.items():
        if not (array.min() >= 0.0 and array.max() <= LIMIT):
            raise StorageError(
                f"the {name} of demonstration {number} is not within 0 and 1", "Scale it as networks here see it."
            )
    return Demonstration(
        shown.stamp_s,
        number,
        shown.episode,
        shown.source if _is_name(shown.source) else Driver.HUMAN,
        _within(shown.action),
        NOTHING,
        stored=True,
        features=shown.features,
    )


def _is_name(source: str) -> bool:
    """Whether a log takes it as the name of a driver."""
    return source.isprintable() and source == source.strip() and 0 < len(source.encode()) <= NAME_BYTES


def _within(action: Action) -> Action:
    linear, angular = (min(1.0, max(-1.0, part)) for part in action)
    return linear, angular
