"""What a session is held to: how long, how many laps, how much proof. Pure."""

from dataclasses import dataclass

from lira.hal.messages import Stage

UNTIMED = frozenset({Stage.PRACTICE, Stage.READY, Stage.PROVING, Stage.EXAM, Stage.JUDGING})


@dataclass(frozen=True, slots=True)
class Rules:
    """`practice_s` of driving come first. `person` is who teaches. At most so many `laps` are taught, and
    for so many `minutes`; with those a proof that was passed ends the session, unless it takes the `whole_time`.
    A twin's proof takes so many `unseen` layouts.
    """

    practice_s: float = 0.0
    person: str = ""
    laps: int = 100
    minutes: float | None = None
    whole_time: bool = False
    unseen: int = 12

    def is_late(self, stage: Stage, taught_s: float) -> bool:
        """Whether the time for teaching is up; a proof that was begun is driven to its end."""
        return self.minutes is not None and stage not in UNTIMED and taught_s > 60.0 * self.minutes
