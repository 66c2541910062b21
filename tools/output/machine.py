"""What a verb prints where `--json` is: an object for a machine, or the same rows as a table for a person."""

import os
import sys
from pathlib import Path
from typing import TextIO

from lira.hal.config import write_whole
from lira.tools.bench import Row, cell, columns
from lira.tools.output.table import format_table


def take_stdout() -> TextIO:
    """Return standard output for the JSON alone; from now on whatever else is printed goes to standard error.

    The libraries below print from C, and may do so as late as at exit: the descriptor itself is moved.
    """
    sys.stdout.flush()
    kept = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return kept


def write_file(path: Path, text: str) -> None:
    """Write the object. Raises `StorageError`."""
    write_whole(path, (text + "\n").encode())


def table(results: list[Row]) -> str:
    """Rows for a person."""
    names = columns(results)
    return format_table(names, [[cell(row.get(name)) for name in names] for row in results])
