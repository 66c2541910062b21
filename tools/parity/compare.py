"""Two recordings against each other: one table of what is compared, and how far apart it may be."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import msgspec
import numpy as np

from lira.hal.messages import STOP
from lira.tools.parity import motion, sight
from lira.tools.parity.record import Recording

SAME, DIFFERS, MISSING = "same", "differs", "missing"
LATE = 99.0  # percentile that stands for "at worst"


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of one robot. Two may differ by `absolute` plus `relative` times the first."""

    name: str
    unit: str
    of: Callable[[Recording], float | None]
    absolute: float
    relative: float = 0.0


class Row(msgspec.Struct, frozen=True):
    """A line of the table. `first` and `second` are None where a robot says nothing, or for a difference of both."""

    name: str
    unit: str
    first: float | None
    second: float | None
    difference: float | None
    allowed: float
    verdict: str
    note: str = ""


def rate_hz(topic: str, recording: Recording) -> float | None:
    """Messages per second over the whole script, by their capture times."""
    times_s = sorted({heard.message.stamp_s for heard in getattr(recording, topic)})
    return (len(times_s) - 1) / (times_s[-1] - times_s[0]) if len(times_s) > 1 else None


def age_s(topic: str, percentile: float, recording: Recording) -> float | None:
    """How old messages were when they came."""
    ages_s = [heard.at_s - heard.message.stamp_s for heard in getattr(recording, topic)]
    return float(np.percentile(ages_s, percentile)) if ages_s else None


def answer_s(recording: Recording) -> float | None:
    """Time from the first command to move until the robot says that the wheels have it."""
    began_s = recording.span("ahead").began_s
    moved = [heard.at_s for heard in recording.applied if heard.at_s > began_s and heard.message.twist != STOP]
    return min(moved) - began_s if moved else None


QUANTITIES = (
    *(
        Quantity(f"{words}: rate", "Hz", partial(rate_hz, topic), 0.5, 0.15)
        for topic, words in (("scan", "lidar"), ("image", "camera"), ("odom", "odometry"), ("imu", "IMU"))
    ),
    *(
        Quantity(
            f"{words}: age{'' if at == 50 else ', p99'}", "s", partial(age_s, topic, at), 0.10 if at == 50 else 0.2
        )
        for topic, words in (("scan", "lidar"), ("image", "camera"), ("odom", "odometry"))
        for at in (50.0, LATE)
    ),
    Quantity("command to its echo", "s", answer_s, 0.1),
    Quantity("ahead: until it moves", "s", partial(motion.delay_s, name="ahead"), 0.15),
    Quantity("ahead: rise, 10 to 90 %", "s", partial(motion.rise_s, name="ahead"), 0.15),
    Quantity("ahead: speed", "m/s", partial(motion.settled, name="ahead"), 0.005, 0.05),
    Quantity("ahead: way", "m", partial(motion.way, name="ahead"), 0.05, 0.05),
    Quantity("ahead: time to stop", "s", partial(motion.halt_s, name="ahead"), 0.15),
    Quantity("ahead: stopping distance", "m", partial(motion.halt_way, name="ahead"), 0.04),
    Quantity("back: speed", "m/s", partial(motion.settled, name="back"), 0.005, 0.05),
    Quantity("left: until it turns", "s", partial(motion.delay_s, name="left"), 0.15),
    Quantity("left: rise, 10 to 90 %", "s", partial(motion.rise_s, name="left"), 0.15),
    Quantity("left: turn rate", "rad/s", partial(motion.settled, name="left"), 0.02, 0.05),
    Quantity("left: turn rate by the IMU", "rad/s", partial(motion.turned_by_imu, name="left"), 0.02, 0.05),
    Quantity("left: turn", "rad", partial(motion.way, name="left"), 0.10, 0.05),
    Quantity("left: turns on after the stop", "rad", partial(motion.halt_way, name="left"), 0.08),
    Quantity("right: turn rate", "rad/s", partial(motion.settled, name="right"), 0.02, 0.05),
    Quantity("lidar: beams that say something", "%", lambda recording: _percent(sight.spoken(recording)), 10.0),
    Quantity("camera: brightness, of 255", "", sight.brightness, 15.0),
)
SCAN_MEDIAN_M, SCAN_APART, IMAGE_GRAY = 0.05, 10.0, 12.0


def compare(first: Recording, second: Recording) -> list[Row]:
    """Return the whole table."""
    rows = [_row(quantity, first, second) for quantity in QUANTITIES]
    match = sight.match_scans(first, second)
    median, apart, fit = (None, None, "") if match is None else (match.median_m, 100.0 * match.apart, match.fit)
    wrong = "" if fit in ("", "as it is") else f"the second scan fits better {fit}"
    return [
        *rows,
        _difference("scans from one place: median", "m", median, SCAN_MEDIAN_M, wrong),
        _difference("scans from one place: beams apart", "%", apart, SCAN_APART, wrong),
        _difference("pictures from one place, of 255", "", sight.match_images(first, second), IMAGE_GRAY),
    ]


def _row(quantity: Quantity, first: Recording, second: Recording) -> Row:
    one, other = quantity.of(first), quantity.of(second)
    if one is None or other is None:
        return Row(quantity.name, quantity.unit, one, other, None, 0.0, MISSING)
    allowed = quantity.absolute + quantity.relative * abs(one)
    verdict = SAME if abs(other - one) <= allowed else DIFFERS
    return Row(quantity.name, quantity.unit, one, other, other - one, allowed, verdict)


def _difference(name: str, unit: str, value: float | None, allowed: float, wrong: str = "") -> Row:
    verdict = MISSING if value is None else SAME if value <= allowed and not wrong else DIFFERS
    return Row(name, unit, None, None, value, allowed, verdict, wrong)


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share


def cells(row: Row) -> list[str]:
    """Return the texts of one line, as printed and as on the page."""
    values = [_words(value) for value in (row.first, row.second)]
    difference = "" if row.difference is None else f"{row.difference:+.3g}"
    if row.first is None and row.second is None:
        difference = difference.removeprefix("+")
    allowed = "" if row.difference is None else f"{row.allowed:.2g}"
    verdict = "" if row.verdict == MISSING else row.verdict
    return [row.name, row.unit, *values, difference, allowed, f"{verdict}: {row.note}" if row.note else verdict]


def _words(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}"
