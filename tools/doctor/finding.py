"""What a check says."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from lira.hal.errors import DeviceError
from lira.hal.profile import RobotProfile

Value = str | float | int | bool | list[str]


class Level(StrEnum):
    """How bad it is."""

    OK = "ok"
    WARNING = "warning"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line: what is so, and what to do about it if that is no good. `values` are its numbers, for programs."""

    level: Level
    what: str
    remedy: str = ""
    values: Mapping[str, Value] = field(default_factory=dict)


def ok(what: str, **values: Value) -> Finding:
    """Nothing is wrong."""
    return Finding(Level.OK, what, "", values)


def warn(what: str, remedy: str, **values: Value) -> Finding:
    """Something works, or may, but not well."""
    return Finding(Level.WARNING, what, remedy, values)


def fail(what: str, remedy: str, **values: Value) -> Finding:
    """Something does not work."""
    return Finding(Level.FAILED, what, remedy, values)


@dataclass(frozen=True, slots=True)
class Patient:
    """What is looked at: always this machine; each of the rest only if it is named. `seconds`: how long, each."""

    profile: RobotProfile
    lidar: str | None = None
    base: str | None = None
    camera: str | None = None
    pad: bool = False
    device: str | None = None
    connect: str | None = None
    name: str = "rosbot"
    openni: Path | None = None
    settings: Path | None = None
    out: Path | None = None
    seconds: float = 4.0


def need(value: str | None) -> str:
    """What was named; a check whose row asks for it is not run without."""
    if value is None:
        raise DeviceError("nothing was named", "Give its URL.")
    return value
