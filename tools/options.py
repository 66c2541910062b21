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


def add_protocol(parser: argparse.ArgumentParser, layouts: str | None = None, proof: str | None = None) -> None:
    """Declare on which layouts is taught and what counts as proof; None: as the method says."""
    usual = "as the method does" if layouts is None else "%(default)s"
    parser.add_argument(
        "--layouts",
        choices=("own", "fresh"),
        default=layouts,
        help=f"training laps: all on --layout (own), or each on another (fresh; default: {usual})",
    )
    parser.add_argument(
        "--proof",
        metavar="own|fresh:K",
        default=proof,
        help="what ends the teaching: the novice alone passes the lap it was just taught on (own), K layouts in a row "
        f"that it has never seen (fresh:K), or K of N (fresh:K/N; default: {usual})",
    )
