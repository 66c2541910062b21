"""What differs from one ROSbot to the next: how its parts are mounted, how its wheels measure. A TOML file."""

import math
import re
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from lira.hal.config import Table, load_toml, parse_toml, read_bounded, write_whole
from lira.hal.description.camera_info import load_calibration
from lira.hal.messages import CameraInfo
from lira.hal.profile import Camera

Scale = Annotated[float, Meta(gt=0.5, lt=2.0)]
Seconds = Annotated[float, Meta(ge=0.0, le=10.0)]


class LidarSettings(Table, frozen=True):
    """The RPLIDAR. `yaw_offset_deg`: the robot's bearing of the unit's angle 0; `mirror`: it hangs upside down.

    `motor_pwm`: duty to begin with, of 1023; from then on the profile's rate is held. `ascending_time`: scans in the
    order of time, clockwise, for consumers that need it.
    """

    yaw_offset_deg: float = 0.0
    mirror: bool = False
    motor_pwm: Annotated[int, Meta(ge=1, le=1023)] = 660
    spin_up_s: Seconds = 1.5
    ascending_time: bool = False

    @property
    def yaw_offset_rad(self) -> float:
        """The offset in radians."""
        return math.radians(self.yaw_offset_deg)


class BaseSettings(Table, frozen=True):
    """The CORE2. True distance and true turn by what it reports; what a turn on the spot adds to its distance."""

    distance_scale: Scale = 1.0
    turn_scale: Scale = 1.0
    spin_slip_m_rad: float = -0.0114  # by the firmware's own arithmetic
    boot_s: Seconds = 2.0  # after the line is opened


class CameraSettings(Table, frozen=True):
    """The camera. `depth`: grab its depth, too, though the profile has none; only OpenNI2 cameras have any.

    `calibration` is a file that ROS's camera_calibration wrote, found from the folder of the settings; "" for none.
    """

    depth: bool = False
    calibration: str = ""


class Settings(Table, frozen=True):
    """All of them."""

    lidar: LidarSettings = LidarSettings()
    base: BaseSettings = BaseSettings()
    camera: CameraSettings = CameraSettings()


def load_settings(path: Path | None) -> Settings:
    """Read a file of settings; without one everything is as delivered. Raises `ConfigError`."""
    return Settings() if path is None else load_toml(path, Settings)


def load_camera_info(path: Path | None, camera: Camera) -> CameraInfo | None:
    """Read the calibration that a file of settings names, None without one. Raises `ConfigError`."""
    name = load_settings(path).camera.calibration
    return load_calibration(path.parent / name, camera) if path is not None and name else None


def write_base_setting(path: Path, key: str, value: float) -> None:
    """Set a key of the table `base` in a file of settings, and leave the rest as it is; makes the file if need be.

    Raises `ConfigError` for a file that is none, `StorageError` if it cannot be written. It is whole at any time.
    """
    load_settings(path if path.exists() else None)
    before = read_bounded(path).decode() if path.exists() else ""
    text = set_key(before, "base", key, repr(round(value, 5)))
    parse_toml(text, Settings, str(path))
    write_whole(path, text.encode())


def set_key(text: str, table: str, key: str, value: str) -> str:
    """Set a key of a table in TOML text: its line is changed, or added, and every other line kept."""
    lines = text.splitlines()
    heads = [number for number, line in enumerate(lines) if re.match(r"\s*\[", line)]
    start = next((number for number in heads if re.match(rf"\s*\[\s*{table}\s*\]", lines[number])), None)
    if start is None:
        return "\n".join([*lines, *([""] if lines else []), f"[{table}]", f"{key} = {value}", ""])
    end = next((number for number in heads if number > start), len(lines))
    for number in range(start + 1, end):
        found = re.match(rf"(\s*{key}\s*=\s*)[^#]*?(\s*(?:#.*)?)$", lines[number])
        if found is not None:
            lines[number] = f"{found[1]}{value}{found[2]}"
            break
    else:
        lines.insert(start + 1, f"{key} = {value}")
    return "\n".join([*lines, ""])
