"""What RESULTS.md leads with: how much of a person it takes until a novice drives where it has never been."""

from collections.abc import Sequence
from functools import partial
from itertools import chain
from pathlib import Path

from lira.hal.config import write_whole
from lira.hal.words import plural
from lira.tools.bench import cell
from lira.tools.experiments.effort.pairs import TOTAL
from lira.tools.experiments.experiment import Picture, Row
from lira.tools.experiments.output.fields import filled, rows_of
from lira.tools.experiments.output.markdown import table
from lira.tools.experiments.output.summary import Summary

LED_BY = "unseen"
# The same place, with more asked of fewer seeds.
ALL_WAYS, RIVALS = f"{LED_BY}-ask", f"{LED_BY}-kernel"
TAUGHT_ON = tuple(f"{LED_BY}-more{laps}" for laps in (1, 5))
PARTS = "ablation"
FIRST = 6  # methods, of a table that is not the main one: the page is to stay short
PICTURE = "docs/results/unseen-human_labels.svg"
HEAD = """# Results

How much of a person it takes until a novice drives, alone, where nobody has taught it. Made by a command, so do not
edit it; how it is measured: [tools/experiments](tools/experiments/README.md).

```
make results SEEDS=10 WORKERS=2     # plays every trial that is missing, writes the summaries and these pages
lira experiment results             # these pages alone, from the summaries that are there
```
"""
NOT_YET = "\nThe experiment `unseen` has not been played yet: `lira experiment unseen --seeds 10`.\n"
EFFORT = """
After each training lap the novice alone drives 12 fresh layouts. Effort to 90 % is what a method had taken when 11 of
them were passed; who did not get there within the cap of laps (12, or `--laps`) is censored, and counts with what it
had used. Unseen: 12 other layouts a run, which decided nothing, driven by the novice that had just reached 90 %,
without any protection. Ratios are the method's effort over that of `plus`, pair by pair of one seed: medians, 95 %
bootstrap intervals; labels without and with the demonstration, which is all that cloning takes. Who asks no
expert does the same with every pair of them.
"""
ALL_PASSED = """
The same until all 12 were passed after a lap (97 %), with the 12 other layouts driven by that novice; of the first
methods, all are in [unseen](docs/results/unseen.md).
"""
DEPLOYED = """
Those that had just reached 90 %, on the same 12 layouts, as they are, behind the protective field, behind the shield,
and with somebody to ask: layouts passed, and collisions.
"""
WITH_ASKING = """
The same of {seeds} seeds in all ways; who asks stops for it: `{command}`{played}
"""
MORE = """
Novices as they were when they had passed all 12, and after more laps of teaching, on the same layouts.
"""
WITH_OUR_NOVICE = """
Other methods with everything of `plus` but its method, its novice and its fresh layouts included, to 90 % as above:
`{command}`{played}
"""
ELSEWHERE = """
The same where the world, the teacher, or the robot is another one than so far; a shift is applied when the novice is
tried, not while it is taught. What was played with an earlier version has the settings of that one.
"""


def lead(summaries: Sequence[Summary]) -> str:
    """Return the first part of the page."""
    found = {each.name: each for each in summaries}
    main = found.get(LED_BY)
    if main is None:
        return HEAD + NOT_YET
    here = (ALL_WAYS, *TAUGHT_ON, RIVALS)
    elsewhere = [each for name, each in found.items() if name.startswith(f"{LED_BY}-") and name not in here]
    played = f"{plural(main.trials, 'trial')}{played_with(main)}"
    parts = [
        HEAD,
        f"\n`{main.command}`: {played}; all tables are in [unseen](docs/results/unseen.md).\n{EFFORT}\n",
        table(effort(main)),
        f"\n![Layouts passed against human labels]({PICTURE})\n" if main.curves else "",
        f"\n## Until it passes all\n{ALL_PASSED}\n" + table(effort(main, 1)[:FIRST]) if efforts(main)[1:] else "",
        f"\n## Deployed\n{DEPLOYED}\n" + table(deployed(main)),
    ]
    if ways := found.get(ALL_WAYS):
        words = WITH_ASKING.format(seeds=ways.seeds, command=ways.command, played=played_with(ways))
        parts.append(f"{words}\n" + table(deployed(ways)))
    if more := [found[name] for name in TAUGHT_ON if name in found]:
        parts.append(f"\n## Taught on\n{MORE}")
        parts += [f"\n`{each.command}`{played_with(each)}\n\n{table(taught_on(each))}" for each in more]
    if rivals := found.get(RIVALS):
        words = WITH_OUR_NOVICE.format(command=rivals.command, played=played_with(rivals))
        parts.append(f"\n## Rivals with the same novice\n{words}\n" + table(effort(rivals)))
    if elsewhere:
        parts.append(f"\n## Elsewhere\n{ELSEWHERE}\n" + table([row for each in elsewhere for row in condition(each)]))
    if PARTS in found and found[PARTS].quality:
        words = f"`{found[PARTS].command}`{played_with(found[PARTS])}"
        parts.append(f"\n## What each part of plus is worth\n\n{words}\n\n" + table(effort(found[PARTS])))
    return "".join(parts)


def leads(summary: Summary) -> bool:
    """Whether it is one of those that the page leads with."""
    return summary.name.startswith(LED_BY) or summary.name == PARTS


def played_with(summary: Summary) -> str:
    """Of which version it is, in words that follow others."""
    return f", played with {summary.commit}" if summary.commit else ""


def efforts(summary: Summary) -> list[list[Row]]:
    """The tables of effort, one for each level of quality, the lowest first."""
    return rows_of(summary, "Effort")


def effort(summary: Summary, level: int = 0) -> list[Row]:
    """One row per method, its pairs of experts together where there are several."""
    return [
        {
            "method": row["method"],
            "runs": row["n"],
            "censored": row["censored"],
            "labels: median, 90 %, worst": spread(row, "human_labels"),
            "interventions": spread(row, "interventions"),
            "demonstration": row["demonstration"],
            "hand, s": row["human_s"],
            "unseen passed": passed(row),
            "collisions per 100 m": row["collisions_100m"],
            "labels over plus": ratio(summary, row, "human_labels"),
            "with demonstration": ratio(summary, row, TOTAL),
            "interventions over plus": ratio(summary, row, "interventions"),
        }
        for rows in efforts(summary)[level : level + 1]
        for row in rows
    ]


def deployed(summary: Summary) -> list[Row]:
    """One row per method, a column per way."""
    found: dict[object, Row] = {}
    for row in chain.from_iterable(rows_of(summary, "Deployed")):
        words = f"{cell(row['unseen_passed'])} of {cell(row['unseen_laps'])}, {cell(row['collisions'])}"
        if row["stops"]:
            words += f", {plural(int(str(row['stops'])), 'stop')}"
        found.setdefault(row["method"], {"method": row["method"]})[cell(row["deployed"])] = words
    return list(found.values())


def taught_on(summary: Summary) -> list[Row]:
    """Two rows per method: when it was proven, and after more laps."""
    return [
        {
            **{key: row[key] for key in ("method", "when")},
            "labels: median, 90 %, worst": spread(row, "human_labels"),
            "interventions": spread(row, "interventions"),
            "unseen passed": passed(row),
            "collisions per 100 m": row["collisions_100m"],
        }
        for row in chain.from_iterable(rows_of(summary, "Taught on"))
    ]


def condition(summary: Summary) -> list[Row]:
    """A line per method of an experiment that differs from the first one in what its name says."""
    return [
        {
            "where": f"[{summary.name.removeprefix(f'{LED_BY}-')}](docs/results/{LED_BY}.md#{summary.name})",
            **{key: row[key] for key in ("method", "runs", "censored", "labels: median, 90 %, worst", "interventions")},
            "unseen passed": row["unseen passed"],
            "collisions per 100 m": row["collisions per 100 m"],
            "played with": summary.commit,
        }
        for row in effort(summary)
    ]


def spread(row: Row, quantity: str) -> str:
    """Median, 90 % quantile and worst, as far as they are there."""
    found = [row[quantity], row[f"{quantity}_90"], row[f"{quantity}_max"]]
    return ", ".join(cell(value) for value in found if value is not None)


def passed(row: Row) -> str:
    """Layouts passed, with the share's interval in percent."""
    if row["unseen_laps"] == 0:
        return "none came so far"
    found = [row[key] for key in ("unseen_passed", "unseen_laps", "share_low", "share_high")]
    if None in found:
        return ""
    low, high = (100.0 * float(str(value)) for value in found[2:])
    return f"{found[0]} of {found[1]} [{low:.0f}, {high:.0f}] %"


def ratio(summary: Summary, of: Row, quantity: str) -> str:
    """A method's ratio in words; nothing for what all are compared with."""
    for row in filled(summary.ratios, "ratios"):
        found = [row[key] for key in ("median", "low", "high")]
        same = (row["against"], row["quantity"], row["quality"]) == (of["method"], quantity, of["quality"])
        if same and None not in found:
            median, low, high = (float(str(value)) for value in found)
            return f"{median:.2g} [{low:.2g}, {high:.2g}]"
    return ""


def draw(summaries: Sequence[Summary], folder: Path) -> None:
    """Draw the curves that the page shows, beside it."""
    from lira.tools.experiments.output import plots
    from lira.tools.experiments.output.page import render

    for summary in summaries:
        rows = [row for row in filled(summary.curves, "curves") if row["quantity"] == "human_labels"]
        rows = [row for row in rows if None not in (row["at"], row["share"])]
        if summary.name == LED_BY and rows:
            _, svg = render(Picture("curves", "", partial(plots.curves, rows)))
            write_whole(folder / PICTURE, svg, folder=True)
