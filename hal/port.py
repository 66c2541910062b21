"""The port that every robot fits: physical, twin, remote, null. The code that drives one drives them all."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from lira.hal.messages import Applied, Command, CourseState, DiagnosticStatus, Episode, Observation
from lira.hal.profile import RobotProfile


class Robot(Protocol):
    """A differential-drive robot with a lidar and a camera.

    The clock belongs to the robot: `now` and every stamp are on it, and `wait` is the only way to let time pass.
    On a physical robot that is the monotonic clock; a twin in lockstep or a replay owns its time.
    """

    @property
    def profile(self) -> RobotProfile:
        """Geometry, limits and sensors."""

    def open(self) -> None:
        """Bring the devices up. Raises `DeviceError` or `BusError` with the remedy."""

    def read(self) -> Observation:
        """Return the newest of every sensor with its capture time; what is absent or stale is None."""

    def drive(self, command: Command) -> Applied:
        """Ask for a velocity and return what the base really got. Never blocks on a sensor."""

    def now(self) -> float:
        """Seconds on the robot's clock."""

    def wait(self, until_s: float) -> None:
        """Let the robot's time pass until `until_s`; at once if that has passed."""

    def close(self) -> None:
        """Stop the wheels, then let go of the devices. May be called twice."""


@runtime_checkable
class MotorSwitch(Protocol):
    """What a robot may have beside the port: a way to take the motors' power away, whatever they are commanded."""

    def cut_motors(self, off: bool) -> None:
        """Cut the power, or give it back. Returns at once; may be called from any thread."""


@runtime_checkable
class SensorEvents(Protocol):
    """What a robot may have beside the port: it says when a sensor has something new."""

    def wait_news(self, until_s: float) -> None:
        """Let the robot's time pass until there is something new to `read`, and until `until_s` at most."""


@dataclass(frozen=True, slots=True)
class DeviceHealth:
    """What a robot says about the devices that it needs in order to move.

    `lost` names those that do not work now; `losses` counts every loss there ever was and never falls, so that one too
    short to be seen, or a board that had to be negotiated with anew, is not missed. `absent` names what the robot is to
    be driven without.
    """

    lost: tuple[str, ...] = ()
    losses: int = 0
    absent: tuple[str, ...] = ()


@runtime_checkable
class DeviceMonitor(Protocol):
    """What a robot may have beside the port: it says which of its devices are lost.

    Whoever governs it stops it then; the robot itself passes on what it is told to drive.
    """

    def device_health(self) -> DeviceHealth:
        """How the devices are now. Returns at once; may be called from any thread."""


@runtime_checkable
class SelfDiagnosis(Protocol):
    """What a robot may have beside the port: what its devices say of themselves, for whoever looks after it."""

    def diagnostics(self) -> tuple[DiagnosticStatus, ...]:
        """One status a device, named after it. Returns at once; may be called from any thread."""


@runtime_checkable
class Restartable(Protocol):
    """What a robot may have beside the port: it can be started anew while it is driven, and its clock with it."""

    def started_anew(self) -> bool:
        """Whether it was since this was asked last. Raises `BusError` if another robot came in its place."""


class Arena(Protocol):
    """What a twin can do and a floor cannot: start afresh, and tell where the robot really is."""

    def reset(self, episode: Episode) -> None:
        """Put the robot down anew. The next `read` belongs to the new episode."""

    def state(self) -> CourseState:
        """Ground truth now."""
