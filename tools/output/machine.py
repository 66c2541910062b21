"""What a verb prints where `--json` is: an object for a machine, or the same rows as a table for a person."""

import json
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


def output_for(file: str | None) -> TextIO:
    """Return where a verb with `--json FILE` prints: where that is standard output, it is for the JSON alone."""
    return take_stdout() if file == "-" else sys.stdout


def tell(file: str | None, output: TextIO, found: object, words: str | None = None) -> None:
    """Write what was found to the FILE of `--json`, and print it for whom `output` is: as JSON, or in words, if any.

    What is text already is JSON. Raises `StorageError`.
    """
    if file is not None:
        text = found if isinstance(found, str) else json.dumps(found, indent=2)
        if file == "-":
            words = text
        else:
            write_file(Path(file), text)
    if words is not None:
        print(words, file=output, flush=True)


def write_file(path: Path, text: str) -> None:
    """Write a text. Raises `StorageError`."""
    write_whole(path, (text + "\n").encode())


def table(results: list[Row]) -> str:
    """Rows for a person."""
    names = columns(results)
    return format_table(names, [[cell(row.get(name)) for name in names] for row in results])
