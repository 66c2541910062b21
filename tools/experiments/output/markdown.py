"""Rows as a table in Markdown."""

from collections.abc import Sequence

from lira.tools.bench import cell, columns
from lira.tools.experiments.experiment import Row


def table(rows: Sequence[Row]) -> str:
    """Return the table; nothing of no rows."""
    if not rows:
        return ""
    names = columns(rows)
    lines = [[name.replace("_", " ") for name in names], ["---"] * len(names)]
    lines += [[cell(row.get(name)).replace("|", "\\|") for name in names] for row in rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"
