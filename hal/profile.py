"""Robot profiles: geometry, limits and sensors of one robot as data.

`thesis-sim` is the simulated robot of the thesis, `rosbot2` the Husarion ROSbot 2.0; a user's own is a TOML file.
"""

import math
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from lira.hal.config import Table, load_toml
from lira.hal.errors import ConfigError

Positive = Annotated[float, Meta(gt=0.0)]
NotNegative = Annotated[float, Meta(ge=0.0)]
Count = Annotated[int, Meta(ge=1)]

# The largest networks and records that are read from a file. Thirty times what any robot here has.
MAX_BINS, MAX_IMAGE_PX, MAX_FILTERS = 4096, 256, 512
Angle = Annotated[float, Meta(gt=0.0, le=6.2832)]

# Law 1: the wheels get zero no later than this after the last valid command.
STOP_BUDGET_S = 0.3


class Base(Table, frozen=True):
    """The body and its drive. `drive`: "kinematic" moves exactly as told, "wheels" has dynamics.

    `track_m` is the one commands are turned into wheel speeds with. Four fixed wheels skid, so the body turns as if
    they stood `effective_track_m` apart, and the odometry reckons with `odometry_track_m` (both `track_m` if absent).
    """

    drive: Literal["kinematic", "wheels"]
    length_m: Positive
    width_m: Positive
    height_m: Positive
    track_m: Positive
    max_linear_m_s: Positive
    max_angular_rad_s: Positive
    acceleration_m_s2: Positive  # the firmware's ramp, "wheels" only
    max_acceleration_m_s2: Positive | None = None  # the governor's, for speeding up; none if absent
    max_angular_acceleration_rad_s2: Positive | None = None
    effective_track_m: Positive | None = None  # "wheels" only
    odometry_track_m: Positive | None = None  # "wheels" only
    wheel_radius_m: Positive | None = None  # for the reader: nothing here turns a wheel by its angle


class Lidar(Table, frozen=True):
    """A planar scanner at (x, z) from base_link's projection on the floor, `beams` over `fov_rad` centred ahead.

    A full turn (`fov_rad` 2 pi) has beams at fov/beams spacing, a sector includes both of its ends.
    """

    x_m: float
    z_m: Positive
    beams: Count
    fov_rad: Angle
    range_min_m: NotNegative
    range_max_m: Positive
    rate_hz: Positive
    noise_m: NotNegative = 0.0  # standard deviation of a range
    dropout: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.0  # share of beams that read nan

    @property
    def full_turn(self) -> bool:
        """Whether it sees all around, so that the last beam is the neighbour of the first."""
        return self.fov_rad > math.tau - 1e-3

    @property
    def increment_rad(self) -> float:
        """Angle between two beams."""
        return self.fov_rad / (self.beams if self.full_turn else max(self.beams - 1, 1))


class Camera(Table, frozen=True):
    """A pinhole camera at (x, z), pitched down by `pitch_rad`. `encoding` is how it travels."""

    x_m: float
    z_m: Positive
    pitch_rad: float
    width_px: Count
    height_px: Count
    hfov_rad: Angle
    vfov_rad: Angle
    rate_hz: Positive
    encoding: Literal["jpeg", "png"]
    noise_gray: NotNegative = 0.0  # standard deviation of a pixel, of 255


class Depth(Table, frozen=True):
    """Distances in the camera's own view, along its optical axis; 0 beyond the two ranges."""

    width_px: Count
    height_px: Count
    range_min_m: Positive
    range_max_m: Annotated[float, Meta(gt=0.0, le=65.0)]  # it travels in millimetres of 16 bits
    rate_hz: Positive = 5.0


class Imu(Table, frozen=True):
    """A gyroscope and two accelerometers in the middle of the body, with the standard deviations of their noise."""

    rate_hz: Positive = 10.0
    noise_rad_s: NotNegative = 0.0
    noise_m_s2: NotNegative = 0.0


class Ranger(Table, frozen=True):
    """An infrared ranger at (x, y, z) that looks along `yaw_rad`; the nearest in its cone of `fov_rad` counts."""

    frame_id: Literal["range_fl", "range_fr", "range_rl", "range_rr"]
    x_m: float
    y_m: float
    z_m: Positive
    yaw_rad: float
    fov_rad: Angle = 0.26
    range_min_m: NotNegative = 0.03
    range_max_m: Positive = 0.90
    rate_hz: Positive = 10.0


class Battery(Table, frozen=True):
    """Voltage when full and when empty, and how long the one takes to become the other."""

    full_v: Positive
    empty_v: Positive
    lasts_s: Positive


class Features(Table, frozen=True):
    """What the networks see: `bins` ranges over `fov_rad` ahead, clipped at `max_range_m`; square pictures.

    `inputs` chooses which features there are, by the names of an observation's fields. `depth` is one more picture,
    clipped at `max_depth_m`, or as the ranges are. `filters` is the width f of the trunks that see pictures (16
    simulated, 32 real).
    """

    fov_rad: Angle
    bins: Annotated[int, Meta(ge=1, le=MAX_BINS)]
    max_range_m: Positive
    image_px: Annotated[int, Meta(ge=1, le=MAX_IMAGE_PX)]
    filters: Annotated[int, Meta(ge=1, le=MAX_FILTERS)]
    inputs: Annotated[tuple[str, ...], Meta(min_length=1)] = ("image", "scan")
    max_depth_m: Positive | None = None


class Control(Table, frozen=True):
    """Rates and time-outs, each longer than the one before, so that the nearest to the fault strikes first.

    A gamepad is silent for `pad_timeout_s` before its bridge commands zero. A command drives for `teleop_timeout_s` or
    `policy_timeout_s` after it was decided. The base stops by itself after `robot_timeout_s` without the HAL server,
    its firmware after `firmware_timeout_s`. A commander that is silent for `lease_s` may be replaced by another.
    """

    rate_hz: Positive
    policy_timeout_s: Positive
    teleop_timeout_s: Positive
    pad_timeout_s: Positive = 0.1
    robot_timeout_s: Positive = STOP_BUDGET_S
    firmware_timeout_s: Positive = 1.0
    lease_s: Positive = 1.0


class Field(Table, frozen=True):
    """Protective field: how far the lidar must see free ground in front of the body, in the direction of motion.

    The way is as wide as the body and `margin_m` on each side. Nearer than `slow_m` the robot goes at most at
    `slow_m_s`, nearer than `stop_m` not at all; the other direction stays free. A scan counts for `max_age_s`.
    """

    stop_m: Positive
    slow_m: Positive
    slow_m_s: Positive
    margin_m: NotNegative
    max_age_s: Positive


# From the hand to the wheels.
NESTED = ("pad_timeout_s", "teleop_timeout_s", "policy_timeout_s", "robot_timeout_s", "firmware_timeout_s")


class RobotProfile(Table, frozen=True):
    """Everything that differs between robots, validated when it loads."""

    name: str
    description: str
    base: Base
    lidar: Lidar
    camera: Camera
    features: Features
    control: Control
    field: Field | None = None
    depth: Depth | None = None
    imu: Imu | None = None
    battery: Battery | None = None
    ranger: tuple[Ranger, ...] = ()

    def __post_init__(self) -> None:
        """Check what no single key can: raises `ValueError`, which loading turns into a `ConfigError`."""
        for key in ("policy_timeout_s", "teleop_timeout_s"):
            value = getattr(self.control, key)
            if value >= STOP_BUDGET_S:
                raise ValueError(f"control.{key} = {value} must be below the stop budget of {STOP_BUDGET_S} s")
        for shorter, longer in [*pairwise(NESTED), ("policy_timeout_s", "lease_s")]:
            self._check_below("control", shorter, longer)
        if self.field is not None:
            self._check_below("field", "stop_m", "slow_m")
        if len(set(self.features.inputs)) < len(self.features.inputs):
            raise ValueError(f"features.inputs = {list(self.features.inputs)} names one twice")
        if self.features.fov_rad > self.lidar.fov_rad + 1e-6:
            raise ValueError(
                f"features.fov_rad = {self.features.fov_rad} is wider than lidar.fov_rad = {self.lidar.fov_rad}"
            )
        if self.features.max_range_m > self.lidar.range_max_m:
            raise ValueError(
                f"features.max_range_m = {self.features.max_range_m} is beyond "
                f"lidar.range_max_m = {self.lidar.range_max_m}"
            )

    def _check_below(self, table: str, lower: str, upper: str) -> None:
        low, high = (getattr(getattr(self, table), key) for key in (lower, upper))
        if low >= high:
            raise ValueError(f"{table}.{lower} = {low} must be below {table}.{upper} = {high}")

    @property
    def period_s(self) -> float:
        """Time between two decisions."""
        return 1.0 / self.control.rate_hz

    def to_json(self) -> bytes:
        """Encode for the bus; `profile_from_json` reads it back."""
        return msgspec.json.encode(self)


def profile_from_json(data: bytes) -> RobotProfile:
    """Decode what `RobotProfile.to_json` wrote. Raises `ConfigError`."""
    try:
        return msgspec.json.decode(data, type=RobotProfile)
    except (msgspec.MsgspecError, ValueError) as error:
        raise ConfigError(
            f"the robot sent a profile that does not load: {error}", "Run one version on both sides."
        ) from error


def known_profiles() -> list[str]:
    """Names of the profiles that come with the project."""
    folder = resources.files("lira.hal") / "profiles"
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_profile(name_or_path: str) -> RobotProfile:
    """Load a profile by name, or a user's own by the path of its TOML file. Raises `ConfigError`."""
    if name_or_path.endswith(".toml"):
        return load_toml(Path(name_or_path), RobotProfile)
    if name_or_path not in known_profiles():
        raise ConfigError(
            f"unknown profile '{name_or_path}'",
            f"Known profiles: {', '.join(known_profiles())}; or give the path of a .toml file.",
        )
    return load_toml(Path(str(resources.files("lira.hal") / "profiles" / f"{name_or_path}.toml")), RobotProfile)
