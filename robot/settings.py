"""What differs from one ROSbot to the next: how its parts are mounted, how its wheels measure. A TOML file."""

import math
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from hal.config import Table, load_toml

Scale = Annotated[float, Meta(gt=0.5, lt=2.0)]
Seconds = Annotated[float, Meta(ge=0.0, le=10.0)]


class LidarSettings(Table, frozen=True):
    """The RPLIDAR. `yaw_offset_deg`: the robot's bearing of the unit's angle 0; `mirror`: it hangs upside down."""

    yaw_offset_deg: float = 0.0
    mirror: bool = False
    motor_pwm: Annotated[int, Meta(ge=1, le=1023)] = 660
    spin_up_s: Seconds = 1.5

    @property
    def yaw_offset_rad(self) -> float:
        """The offset in radians."""
        return math.radians(self.yaw_offset_deg)


class BaseSettings(Table, frozen=True):
    """The CORE2. True distance and true turn by what it reports; what a turn on the spot adds to its distance."""

    distance_scale: Scale = 1.0
    turn_scale: Scale = 1.0
    spin_slip_m_rad: float = 0.0
    boot_s: Seconds = 2.0  # after the line is opened


class Settings(Table, frozen=True):
    """All of them."""

    lidar: LidarSettings = LidarSettings()
    base: BaseSettings = BaseSettings()


def load_settings(path: Path | None) -> Settings:
    """Read a file of settings; without one everything is as delivered. Raises `ConfigError`."""
    return Settings() if path is None else load_toml(path, Settings)
