"""What a fault is tried on: which robot, which commander, which link."""

from dataclasses import dataclass
from pathlib import Path

LIBRARIES = "/usr/lib/*/faketime/libfaketimeMT.so.1", "/usr/lib*/faketime/libfaketimeMT.so.1"


@dataclass(frozen=True, slots=True)
class Stand:
    """One arrangement of processes. Without anything: a twin, a driver by word, and a relay between them.

    `profile` None: what was asked for. `fusion`: words for `lira fusion`, which then is the commander; `{run}` is a
    folder. `drivers`: the robot's are the physical ones, on the devices of a world in another process. `link`: a
    process of its own in the link. `clocks`: the time of day can be set in each process. `keys`: the bus has some.
    """

    name: str
    profile: str | None = None
    fusion: tuple[str, ...] = ()
    drivers: bool = False
    link: bool = False
    clocks: bool = False
    keys: bool = False


BY_WORD = Stand("a twin and a driver by word")
FUSION = Stand("lira fusion", profile="thesis-sim", fusion=("--policy", "camera-expert"))
LEARNER = Stand(
    "lira fusion, learning",
    profile="thesis-sim",
    fusion=("--method", "lira", "--start", "experts", "--run", "{run}"),
)
DRIVERS = Stand("the physical robot's drivers", drivers=True)
LINK = Stand("a process in the link", link=True)
CLOCKS = Stand("clocks that can be set", clocks=True)
KEYED = Stand("keys", keys=True)


def clock_library() -> Path | None:
    """Return libfaketime, None where it is not installed."""
    return next((path for pattern in LIBRARIES for path in sorted(Path("/").glob(pattern[1:]))), None)
