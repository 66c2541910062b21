"""What a study found: each measure by method, and every pair of methods within people, with 95 % intervals."""

from collections.abc import Mapping, Sequence
from html import escape
from itertools import combinations
from statistics import median

from lira.hal.words import plural
from lira.tools.experiments.effort.statistics import median_interval
from lira.tools.output.proven import share_words
from lira.tools.report.page import section, styled
from lira.tools.report.pair import table
from lira.tools.study.table import MEASURES, BlockRow

FEWEST = 2  # people, for an interval


def paired(rows: Sequence[BlockRow], measure: str, methods: tuple[str, str]) -> list[float]:
    """Second method minus first, of each person who did both and of whom both were measured."""
    by: dict[str, dict[str, float]] = {}
    for row in rows:
        value = getattr(row, measure)
        if value is not None:
            by.setdefault(row.participant, {})[row.method] = float(value)
    first, second = methods
    return [each[second] - each[first] for each in by.values() if first in each and second in each]


def render(title: str, rows: Sequence[BlockRow]) -> str:
    """Return the page."""
    methods = list(dict.fromkeys(row.method for row in rows))
    people = {row.participant for row in rows}
    body = f"<h1>{escape(title)}</h1><p>{plural(len(people), 'participant')}, {plural(len(rows), 'block')}.</p>"
    groups = {name: [row for row in rows if row.method == name] for name in methods}
    body += section("By method", "Medians; passed: the proof, with its interval.", table(*_by_method(groups)))
    note = "Median of the differences within people, second minus first, with the 95 % interval of a bootstrap."
    body += section("Within people", note, table(*_pairs(rows, methods)))
    return styled(title, body)


def _by_method(groups: Mapping[str, Sequence[BlockRow]]) -> tuple[list[str], list[list[str]]]:
    lines = []
    for name, rows in groups.items():
        cells = [name, share_words(sum(row.passed for row in rows), len(rows), "block", " passed")]
        for measure in MEASURES:
            values = [value for row in rows if (value := getattr(row, measure)) is not None]
            cells.append(f"{median(values):.1f}" if values else "")
        lines.append(cells)
    return ["method", "passed", *MEASURES], lines


def _pairs(rows: Sequence[BlockRow], methods: Sequence[str]) -> tuple[list[str], list[list[str]]]:
    lines = []
    for first, second in combinations(methods, 2):
        for measure in MEASURES:
            differences = paired(rows, measure, (first, second))
            if len(differences) < FEWEST:
                continue
            middle, low, high = median_interval(differences)
            lines.append(
                [f"{second} - {first}", measure, f"{middle:+.1f}", f"{low:+.1f} to {high:+.1f}", str(len(differences))]
            )
    return ["methods", "measure", "median", "95 %", "people"], lines
