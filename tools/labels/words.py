"""A log of labels in words: tables for a person, rows for JSON."""

from collections.abc import Mapping, Sequence
from typing import Any

from lira.fusion.learning.learned_policy import Contradiction, Part
from lira.fusion.log.label_file import Demonstration
from lira.hal.words import plural
from lira.tools.labels.numbers import ranges
from lira.tools.output.table import format_table
from lira.tools.output.when import when

LISTED = ("number", "run", "lap", "time", "source", "speed, turn", "novice's", "")
EXPLAINED = ("number", "run", "lap", "time", "source", "says speed, turn", "likeness", "adds to speed", "adds to turn")
SHOWN = 10
UNCHANGED = {  # a label by its state: why it is not taken back, or not learned again
    "learned": "learned already, it is not taken back",
    "taken back": "taken back already",
    "redundant or objected to": "redundant or objected to, so never learned, and not taken back either",
}


def state(label: Demonstration, aside: Contradiction | None) -> str:
    """What became of a label; `aside` is how it contradicts the others, if it does."""
    if label.undone:
        return "taken back"
    if not label.stored:
        return "redundant or objected to"
    if aside is None:
        return "learned"
    return "learned; its mirror image contradicts the rest" if aside.mirrored else "contradicts the rest"


def unchanged(labels: Sequence[Demonstration], numbers: Sequence[int]) -> list[str]:
    """Why nothing changed with some labels that were meant, a line for each reason."""
    lines = []
    for which, why in UNCHANGED.items():
        same = [number for number in numbers if state(labels[number], None) == which]
        lines += [f"nothing changed with {ranges(same)}: {why}"] if same else []
    return lines


def pair(action: tuple[float, float]) -> str:
    """Speed and turn."""
    return f"{action[0]:+.2f}, {action[1]:+.2f}"


def list_rows(labels: Sequence[Demonstration], aside: Mapping[int, Contradiction]) -> list[dict[str, Any]]:
    """All labels, for JSON; `aside` are those that contradict the others, by their numbers in the log."""
    return [
        {
            "number": number,
            "run": label.run,
            "lap": label.lap,
            "stamp_s": label.stamp_s,
            "source": label.source,
            "action": label.action,
            "novice": label.novice,
            "state": state(label, aside.get(number)),
        }
        for number, label in enumerate(labels)
    ]


def list_table(rows: Sequence[dict[str, Any]]) -> str:
    """The same for a person."""
    cells = [
        [
            *(str(row[name]) for name in ("number", "run", "lap")),
            when(row["stamp_s"]),
            row["source"],
            pair(row["action"]),
            pair(row["novice"]),
            row["state"],
        ]
        for row in rows
    ]
    return format_table(LISTED, cells)


def part_rows(parts: Sequence[Part], learned: Sequence[int], labels: Sequence[Demonstration]) -> list[dict[str, Any]]:
    """What makes an action, for JSON; `learned` are the numbers that the parts' labels have in the log."""
    return [
        {
            "number": learned[part.number],
            "run": labels[learned[part.number]].run,
            "lap": labels[learned[part.number]].lap,
            "stamp_s": labels[learned[part.number]].stamp_s,
            "source": part.source,
            "action": part.action,
            "likeness": part.likeness,
            "share": part.share,
        }
        for part in parts
    ]


def part_table(rows: Sequence[dict[str, Any]]) -> str:
    """The largest of them for a person, and the sum of the rest."""
    cells = [
        [
            *(str(row[name]) for name in ("number", "run", "lap")),
            when(row["stamp_s"]),
            row["source"],
            pair(row["action"]),
            f"{row['likeness']:.2f}",
            *(f"{share:+.3f}" for share in row["share"]),
        ]
        for row in rows[:SHOWN]
    ]
    rest = rows[SHOWN:]
    if rest:
        sums = [f"{sum(row['share'][k] for row in rest):+.3f}" for k in (0, 1)]
        cells.append([plural(len(rest), "other"), *[""] * 6, *sums])
    return format_table(EXPLAINED, cells)
