"""Types of command-line arguments. What does not fit is refused by argparse, with exit status 2."""

import argparse


def natural(text: str) -> int:
    """Read a whole number that is not negative: a seed, a layout, a count."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number from 0 on")
    return value
