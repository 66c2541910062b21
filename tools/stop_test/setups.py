"""What a row is tried on: which robot, which commander, which link."""

from dataclasses import dataclass
from pathlib import Path

# Names on certificates, where there are keys.
LAPTOP, RIVAL, GUEST, BRIEF, LEAVER = "laptop", "rival", "guest", "brief", "leaver"
LIBRARIES = "/usr/lib/*/faketime/libfaketimeMT.so.1", "/usr/lib*/faketime/libfaketimeMT.so.1"


@dataclass(frozen=True, slots=True)
class Setup:
    """One arrangement of processes. Without anything: a twin, a driver by control messages, and a relay between them.

    `profile` None: what was asked for. `fusion`: what `lira` is told, which then is the commander; `{run}` is a
    folder. `drivers`: the robot's are the physical ones, on the devices of a world in another process. `ros2`: the
    robot runs ROS 2, and what is tested is on this side of its bridge. `link`: a process of its own in the link.
    `clocks`: the time of day can be set in each process. `keys`: the bus has some.
    """

    name: str
    profile: str | None = None
    fusion: tuple[str, ...] = ()
    drivers: bool = False
    ros2: bool = False
    link: bool = False
    clocks: bool = False
    keys: bool = False

    @property
    def world(self) -> bool:
        """Whether the wheels are in another process than the governor."""
        return self.drivers or self.ros2


TWIN = Setup("a twin and a driver by control messages")
FUSION = Setup("lira drive", profile="thesis-sim", fusion=("drive", "camera-expert"))
LEARNER = Setup(
    "lira fusion, learning",
    profile="thesis-sim",
    fusion=("fusion", "--method", "lira", "--start", "experts", "--run", "{run}"),
)
DRIVERS = Setup("the physical robot's drivers", drivers=True)
ROS2 = Setup("a robot that runs ROS 2", ros2=True)
LINK = Setup("a process in the link", link=True)
CLOCKS = Setup("clocks that can be set", clocks=True)
KEYED = Setup("keys", keys=True)


def clock_library() -> Path | None:
    """Return libfaketime, None where it is not installed."""
    return next((path for pattern in LIBRARIES for path in sorted(Path("/").glob(pattern[1:]))), None)
