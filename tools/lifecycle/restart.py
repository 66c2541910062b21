"""When one process is started, given up and started again. Pure: times come in as arguments."""

from dataclasses import dataclass
from enum import StrEnum

FIRST_S = 1.0
LONGEST_S = 30.0
CALM_S = 60.0  # who has run for so long has not failed in a row
READY_S = 90.0  # to load what it takes on a slow machine


class Phase(StrEnum):
    """What a process does."""

    WAITS = "waits"  # to be started: for the robot, or for its pause to pass
    STARTS = "starts"
    RUNS = "runs"
    STOPPED = "stopped"  # with all the others


def pause_s(failures: int) -> float:
    """How long to wait after so many failures in a row: twice as long each time."""
    return min(LONGEST_S, FIRST_S * 2.0 ** min(failures - 1, 16)) if failures > 0 else 0.0


@dataclass(slots=True)
class Restarts:
    """The life of one process. `patience_s` is how long it may be silent once it runs.

    `starts` counts how often it was started, `since_s` is when its phase began, `due_s` when it is started.
    """

    patience_s: float
    phase: Phase = Phase.WAITS
    since_s: float = 0.0
    due_s: float = 0.0
    starts: int = 0
    failures: int = 0
    heard_s: float = 0.0

    def is_due(self, now_s: float) -> bool:
        """Whether it is to be started now."""
        return self.phase is Phase.WAITS and now_s >= self.due_s

    def started(self, now_s: float) -> None:
        """It was started."""
        self.starts += 1
        self._enter(Phase.STARTS, now_s)

    def ready(self, now_s: float) -> None:
        """It said that it does its work."""
        if self.phase is Phase.STARTS:
            self._enter(Phase.RUNS, now_s)

    def alive(self, now_s: float) -> None:
        """It gave a sign of life."""
        self.heard_s = now_s

    def is_hung(self, now_s: float) -> bool:
        """Whether it takes too long to get ready, or was silent for too long."""
        limits = {Phase.STARTS: READY_S, Phase.RUNS: self.patience_s}
        limit_s = limits.get(self.phase)
        return limit_s is not None and now_s - self.heard_s > limit_s

    def ended(self, now_s: float) -> float:
        """It ended though nobody asked it to. Returns how long to wait before it is started again."""
        calm = self.phase is Phase.RUNS and now_s - self.since_s >= CALM_S
        self.failures = 1 if calm else self.failures + 1
        wait_s = pause_s(self.failures)
        self.due_s = now_s + wait_s
        self._enter(Phase.WAITS, now_s)
        return wait_s

    def stopped(self, now_s: float) -> None:
        """It was asked to end, and has."""
        self._enter(Phase.STOPPED, now_s)

    def _enter(self, phase: Phase, now_s: float) -> None:
        self.phase, self.since_s, self.heard_s = phase, now_s, now_s
