"""The table of a study: one row a block, appended as they come; and what of it may be given away."""

import csv
import io
import random
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import msgspec

from lira.hal.config import write_whole
from lira.hal.errors import StorageError
from lira.tools.report.answers import sum_up
from lira.tools.report.digest import Run
from lira.tools.study.questions import Answered

TABLE, EXPORT, ANALYSIS = "blocks.csv", "export.csv", "analysis.html"


@dataclass(frozen=True, slots=True)
class BlockRow:
    """One participant by one method. Times in seconds; `passed` is the proof's; empty where nothing was measured."""

    participant: str
    place: int
    method: str
    shown_as: str
    passed: bool
    unseen_passed: int
    unseen: int
    laps: int
    collisions: int
    lost: int
    human_labels: int
    demonstration: int
    interventions: int
    calls: int
    answered: int
    missed: int
    reaction_s: float | None
    human_s: float
    duration_s: float
    mental: int
    physical: int
    temporal: int
    performance: int
    effort: int
    frustration: int
    tlx: float
    words: str = ""


MEASURES = ("human_labels", "demonstration", "interventions", "missed", "reaction_s", "human_s", "duration_s", "tlx")


def row_of(run: Run, participant: str, place: int, method: str, shown_as: str, answered: Answered) -> BlockRow:
    """One row, from the block's record and the answers after it."""
    result, human = run.result, sum_up(run)
    training = [lap.record for lap in run.phase("train") if lap.record]
    unseen = [lap.record for lap in run.phase("unseen") if lap.record]
    passed = run.verdict.passed if run.verdict else bool(result and result.converged)
    reactions = sorted(human.reactions_s)
    return BlockRow(
        participant,
        place,
        method,
        shown_as,
        passed=passed,
        unseen_passed=sum(lap.passed for lap in unseen),
        unseen=len(unseen),
        laps=len(training),
        collisions=sum(lap.collisions for lap in training),
        lost=sum(lap.lost for lap in training),
        human_labels=result.human_labels if result else 0,
        demonstration=result.demonstration if result else 0,
        interventions=result.interventions if result else 0,
        calls=human.calls,
        answered=len(reactions),
        missed=human.missed,
        reaction_s=round(reactions[len(reactions) // 2], 3) if reactions else None,
        human_s=round(human.human_s, 1),
        duration_s=round(result.simulated_s, 1) if result else 0.0,
        **answered.load,
        tlx=round(answered.total, 2),
        words=" | ".join(f"{question} {said}" for question, said in answered.words.items()),
    )


def write_rows(path: Path, rows: Sequence[BlockRow], leave_out: Sequence[str] = ()) -> Path:
    """Write a table whole. Raises `StorageError`."""
    names = [field.name for field in fields(BlockRow) if field.name not in leave_out]
    text = io.StringIO()
    writer = csv.DictWriter(text, names, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(row) for row in rows)
    write_whole(path, text.getvalue().encode())
    return path


def read_rows(path: Path) -> list[BlockRow]:
    """Read a table; empty where there is none yet. Raises `StorageError` for what is none."""
    if not path.is_file():
        return []
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return [
                msgspec.convert({**row, "reaction_s": row["reaction_s"] or None}, BlockRow, strict=False)
                for row in csv.DictReader(file)
            ]
    except (OSError, ValueError, KeyError, csv.Error) as error:
        raise StorageError(f"{path} is no table of a study: {error}", "Is it the right folder?") from error


def export(path: Path, rows: Sequence[BlockRow]) -> Path:
    """Write what may be given away: no names, no free words, participants by numbers drawn anew and in their order."""
    people = sorted({row.participant for row in rows})
    numbers = random.SystemRandom().sample(range(100, 1000 + 9 * len(people)), len(people))
    known = dict(zip(people, (f"p{number}" for number in numbers), strict=True))
    hidden = sorted((replace(row, participant=known[row.participant]) for row in rows), key=_place)
    return write_rows(path, hidden, leave_out=("words",))


def _place(row: BlockRow) -> tuple[str, int]:
    return row.participant, row.place
