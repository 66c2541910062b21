"""Labels' numbers as they are written: 3 7-9."""

import argparse
from collections.abc import Sequence

MOST = 100_000


def numbers(text: str) -> tuple[int, ...]:
    """Read 12 or 12-15. For argparse."""
    first, dash, last = text.partition("-")
    if not first.isdecimal() or (dash and not last.isdecimal()):
        raise argparse.ArgumentTypeError(f"'{text}' is no label's number, nor a range like 12-15")
    low, high = int(first), int(last or first)
    if not low <= high < low + MOST:
        raise argparse.ArgumentTypeError(f"'{text}' is no range of at most {MOST} numbers")
    return tuple(range(low, high + 1))


def ranges(found: Sequence[int]) -> str:
    """Write numbers, in order, as `numbers` reads them."""
    parts: list[list[int]] = []
    for number in found:
        if parts and number == parts[-1][-1] + 1:
            parts[-1].append(number)
        else:
            parts.append([number])
    return " ".join(str(part[0]) if len(part) == 1 else f"{part[0]}-{part[-1]}" for part in parts)
