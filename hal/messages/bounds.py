"""How much any value off the bus may be, by its type: what is beyond makes its message none.

Behind these bounds nobody has to ask again whether a number can be computed with, rounded, sent on or shown. A number
that is absent is nan, as everywhere here.
"""

import math
from dataclasses import fields, is_dataclass
from typing import Any

from lira.hal.messages import Imu, LaserScan, Odometry, Text, Twist

LARGEST = 1e10  # of any number in SI units: a time since 1970 fits
LONGEST_TEXT = 4096
LONGEST_MODEL = 2**18  # of a robot, as URDF
MOST_ITEMS = 1024
MOST_BEAMS = 16_384
INTEGERS = range(-(2**63), 2**63)
TOKENS = range(2**64)  # a session's epoch, and its digest
FULL_TURNS_RAD = 2 * math.tau
_ALL_FINITE = (Odometry, Imu)  # what draws or adds them up has no use for a part of one
_ENDLESS = ("range_m", "clearance_m")  # there may be nothing there


def check(message: Any) -> None:
    """Raise `ValueError` for a message with a value that is out of bounds.

    A `Twist` by itself may hold anything: the governor stops the robot for one that is not finite.
    """
    if not isinstance(message, Twist):
        _check(message, type(message).__name__)


def _check(value: Any, name: str) -> None:
    if isinstance(value, float):
        _need(not abs(value) > LARGEST or (name in _ENDLESS and math.isinf(value)), name, value)
    elif isinstance(value, int):
        _need(value in (TOKENS if name in ("epoch", "session") else INTEGERS), name, value)
    elif isinstance(value, str):
        _need(len(value) <= LONGEST_TEXT, name, f"{len(value)} characters")
    elif isinstance(value, tuple):
        _need(len(value) <= MOST_ITEMS, name, f"{len(value)} items")
        for item in value:
            _check(item, name)
    elif isinstance(value, Text):
        _need(len(value.data) <= LONGEST_MODEL, name, f"{len(value.data)} characters")
    elif isinstance(value, LaserScan):
        _check_scan(value)
    elif is_dataclass(value):
        for field in fields(value):
            part = getattr(value, field.name)
            _check(part, field.name)
            _need(
                not (isinstance(value, _ALL_FINITE) and isinstance(part, float)) or math.isfinite(part),
                field.name,
                part,
            )


def _check_scan(scan: LaserScan) -> None:
    """The ranges themselves may be anything (REP-117); where they point has to be known."""
    _need(len(scan.ranges) <= MOST_BEAMS, "ranges", f"{len(scan.ranges)} beams")
    _need(abs(scan.angle_min) <= FULL_TURNS_RAD, "angle_min", scan.angle_min)
    _need(abs(scan.angle_increment) * len(scan.ranges) <= FULL_TURNS_RAD, "angle_increment", scan.angle_increment)
    _need(0.0 <= scan.range_min <= LARGEST, "range_min", scan.range_min)
    _need(scan.range_max >= 0.0, "range_max", scan.range_max)
    for name in ("scan_time", "time_increment"):
        _check(getattr(scan, name), name)


def _need(holds: bool, name: str, value: object) -> None:
    if not holds:
        raise ValueError(f"{name} is out of bounds: {value}")
