"""Two runs side by side: what each came to, lap by lap, and who drove when."""

from html import escape
from itertools import zip_longest

from lira.tools.report.digest import Run
from lira.tools.report.laps import COLUMNS, lap_cells
from lira.tools.report.page import figures, method_name, outcome, section, strips, styled

CHOSEN = ("passed", "without human", "time", "collisions", "line lost", "human labels", "interventions", "calls")


def render_pair(runs: tuple[Run, Run], names: tuple[str, str]) -> str:
    """Return a page on two runs."""
    title = " and ".join(names)
    parts = [f"<h1>{escape(title)}</h1>", _figures(runs, names), _laps(runs, names)]
    parts += [f"<h2>{escape(name)}</h2>{strips(run)}" for name, run in zip(names, runs, strict=True)]
    return styled(title, "".join(parts))


def _figures(runs: tuple[Run, Run], names: tuple[str, str]) -> str:
    """Every number of either run."""
    left, right = (dict(_facts(run)) for run in runs)
    rows = [[name, left.get(name, ""), right.get(name, "")] for name in dict.fromkeys([*left, *right])]
    return section("What they came to", "", table(["", *names], rows))


def _facts(run: Run) -> list[tuple[str, str]]:
    about = [("world", run.head.world), ("method", method_name(run))] if run.head else []
    return [*about, ("outcome", outcome(run)[0]), *figures(run)]


def _laps(runs: tuple[Run, Run], names: tuple[str, str]) -> str:
    """The laps in the order in which they were driven."""
    header = ["lap", *(f"{name}: {column}" for column in CHOSEN for name in names)]
    rows = []
    for number, laps in enumerate(zip_longest(*(run.laps for run in runs)), start=1):
        cells = [{} if lap is None else dict(zip(COLUMNS, lap_cells(lap), strict=True)) for lap in laps]
        titles = dict.fromkeys(each["lap"] for each in cells if each)
        row = [f"{number}: {' / '.join(titles)}"]
        rows.append(row + [each.get(column, "") for column in CHOSEN for each in cells])
    return section("Lap by lap", "", table(header, rows))


def table(header: list[str], rows: list[list[str]]) -> str:
    """A table that scrolls where it is wide."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="scroll"><table><tr>{head}</tr>{body}</table></div>'
