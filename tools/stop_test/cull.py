"""Breaks the product in one known way after the other, and sees whether the rows meant for that fail."""

from collections.abc import Callable, Sequence
from pathlib import Path

from lira.tools.stop_test.matrix import Matrix
from lira.tools.stop_test.mutants import Mutant
from lira.tools.stop_test.rows import ROWS, Row
from lira.tools.stop_test.verdict import Result

FAILED = "failed"


def cull(
    mutants: Sequence[Mutant],
    folder: Path,
    profile: str,
    seed: int,
    say_row: Callable[[Result], None],
    say_mutant: Callable[[Result], None],
) -> list[Result]:
    """Try the rows of every mutant, first without any: a row that fails by itself catches nothing."""
    sound = _passed(Matrix(folder / "sound", profile, seed), rows_of(mutants), 1, say_row)
    results = []
    for number, mutant in enumerate(mutants):
        matrix = Matrix(folder / str(number), profile, seed, mutant)
        broken = _passed(matrix, rows_of([mutant]), mutant.trials, say_row)
        results.append(judge_mutant(mutant, sound, broken))
        say_mutant(results[-1])
    return results


def rows_of(mutants: Sequence[Mutant]) -> list[Row]:
    """The rows meant for these mutants, in the order of the table. Raises `ValueError` for one that is not there."""
    names = {name for mutant in mutants for name in mutant.rows}
    if unknown := names - {row.name for row in ROWS}:
        raise ValueError(f"no row is called {', '.join(sorted(unknown))}")
    return [row for row in ROWS if row.name in names]


def judge_mutant(mutant: Mutant, sound: dict[str, str], broken: dict[str, str]) -> Result:
    """Whether every row meant for it failed, and failed because of it. Both say how rows went: "", "failed" or why
    they could not be tried, which catches nothing.
    """
    why = [f"{name}: {sound[name]} without it" for name in mutant.rows if sound[name]]
    why += [f"{name}: {broken[name] or 'passed'}" for name in mutant.rows if broken[name] != FAILED]
    return {
        "mutant": mutant.name,
        "rows": ", ".join(mutant.rows),
        "caught": not why,
        "why": "; ".join(why) or "all of its rows failed",
    }


def _passed(matrix: Matrix, rows: Sequence[Row], trials: int, say: Callable[[Result], None]) -> dict[str, str]:
    """Try rows, and say how each went."""
    results = matrix.run(rows, trials, say)
    return {str(one["fault"]): "" if one["passed"] else str(one.get("error", FAILED)) for one in results}
