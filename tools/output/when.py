"""A time on a robot's clock, in words: a robot in real time counts from 1970, a twin in lockstep from its start."""

import argparse
from datetime import UTC, datetime

from lira.hal.clock import COUNTS_FROM_1970_S


def when(stamp_s: float) -> str:
    """Return the time of day here, or seconds."""
    if stamp_s < COUNTS_FROM_1970_S:
        return f"{stamp_s:.1f} s"
    time = datetime.fromtimestamp(round(stamp_s, 1), UTC).astimezone()
    return f"{time:%Y-%m-%d %H:%M:%S}.{round(time.microsecond / 1e5)}"


def stamp(text: str) -> float:
    """Read what `when` says, or seconds alone. For argparse."""
    try:
        return float(text.removesuffix("s"))
    except ValueError:
        pass
    try:
        return datetime.fromisoformat(text).astimezone().timestamp()
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"'{text}' is no time like 41.2 or '2026-11-27 10:15:00.2'") from error
