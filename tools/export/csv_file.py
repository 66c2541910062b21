"""CSV: a line a step, a number or a word a cell. Scans and pictures are left out."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from lira.hal.errors import StorageError
from lira.tools.export.columns import SCAN, Table


def write_csv(tables: Sequence[Table], path: Path) -> None:
    """Write a new file. Raises `StorageError`."""
    try:
        with path.open("x", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["episode", "step", *_heads(tables[0])])
            for episode, table in enumerate(tables):
                writer.writerows([episode, step, *cells] for step, cells in enumerate(_rows(table)))
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}", "Choose another file.") from error


def _heads(table: Table) -> list[str]:
    shown = [column for column in table.columns if column.name != SCAN]
    return [
        name
        for column in shown
        for name in ([f"{column.name}.{part}" for part in column.names] if column.names else [column.name])
    ]


def _rows(table: Table) -> Iterator[list[Any]]:
    columns = [column.values.tolist() for column in table.columns if column.name != SCAN]
    for cells in zip(*columns, strict=True):
        yield [value for cell in cells for value in (cell if isinstance(cell, list) else [_word(cell)])]


def _word(cell: Any) -> Any:
    return int(cell) if isinstance(cell, bool) else cell
