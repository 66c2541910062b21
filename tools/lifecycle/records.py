"""What is written down about a robot that is up, and what `lira status` tells of it."""

import msgspec

from lira.tools.lifecycle.restart import Phase
from lira.tools.lifecycle.setup import Setup

STATE = "state.json"
HEARD = "heard.json"


class ProcessState(msgspec.Struct, frozen=True):
    """One process. `since_s` is on this machine's monotonic clock; `says` its own word, `ended` how it ended last."""

    name: str
    does: str
    phase: Phase
    since_s: float
    pid: int | None = None
    starts: int = 0
    says: str = ""
    ended: str = ""


class State(msgspec.Struct, frozen=True):
    """All that one supervisor has started, or systemd, whose `pid` is 0 here."""

    setup: Setup
    pid: int
    since_s: float
    processes: tuple[ProcessState, ...]

    @property
    def is_monitored(self) -> bool:
        """Whether one of them listens to the robot."""
        return any(process.name == "monitor" for process in self.processes)

    @property
    def runs(self) -> bool:
        """Whether all of it runs."""
        return all(process.phase is Phase.RUNS for process in self.processes)


class TopicState(msgspec.Struct, frozen=True):
    """One topic as it is heard here: how often, how often it should be, and how old the newest is."""

    key: str
    rate_hz: float
    expected_hz: float
    age_s: float | None


class Heard(msgspec.Struct, frozen=True):
    """What the monitor heard, and when, on this machine's monotonic clock.

    `link` and `governor` are what the robot says about its links and its state; the rest is what every screen says.
    """

    time_s: float
    topics: tuple[TopicState, ...]
    link: str
    governor: str
    situation: str
    urgency: str
    who: str
    why: str
    now: str
