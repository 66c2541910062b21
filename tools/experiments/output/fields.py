"""The fields of kept summaries that RESULTS.md shows: one that an earlier version did not keep is an empty cell."""

from collections.abc import Sequence
from itertools import chain

from lira.tools.experiments.experiment import Row
from lira.tools.experiments.output.summary import Summary

TAILS = tuple(f"{name}{tail}" for name in ("human_labels", "interventions") for tail in ("", "_90", "_max"))
DRIVEN = ("unseen_laps", "unseen_passed")
SHARE = ("share_low", "share_high", "collisions_100m")
SHOWN = {  # by how the titles of tables begin
    "Effort": ("method", "quality", "n", "censored", *TAILS, "demonstration", "human_s", *DRIVEN, *SHARE),
    "Deployed": ("method", "deployed", *DRIVEN, "collisions", "stops"),
    "Taught on": ("method", "when", *TAILS, *DRIVEN, *SHARE),
    "ratios": ("method", "against", "quantity", "quality", "median", "low", "high"),
    "curves": ("method", "quantity", "at", "share"),
}


def rows_of(summary: Summary, title: str) -> list[list[Row]]:
    """The rows of each table whose title begins so, with all that is shown of them."""
    return [filled(each.rows, title) for each in summary.tables if each.title.startswith(title)]


def filled(rows: Sequence[Row], shown: str) -> list[Row]:
    """Rows with all that is shown of them; None for what they lack."""
    return [dict.fromkeys(SHOWN[shown]) | row for row in rows]


def lacking(summary: Summary) -> list[str]:
    """Say which fields that are shown a summary has not."""
    tables = [(each.title, each.rows) for each in summary.tables]
    found: dict[str, None] = {}
    for title, rows in (*tables, ("ratios", summary.ratios), ("curves", summary.curves)):
        shown = chain.from_iterable(names for start, names in SHOWN.items() if title.startswith(start))
        found |= {f"{name} in '{title}'": None for name in shown if any(name not in row for row in rows)}
    return list(found)
