"""Runs the trials that are missing, side by side, and says how far it is. What is done is kept in a folder."""

import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Self

import msgspec
from tqdm import tqdm

from lira.hal.words import plural
from lira.tools.experiments.playing.fingerprint import fingerprint
from lira.tools.experiments.playing.kept import keep, kept
from lira.tools.experiments.trial import Outcome, Trial

Pool = Callable[[Sequence[Trial]], Iterator[Outcome]]
"""Plays trials and yields what came of them, in whatever order they end."""


def run_trials(trials: Sequence[Trial], folder: Path, pool: Pool) -> list[Outcome]:
    """Return the outcomes in the order of the trials: read where the folder has them, else played now.

    An outcome of other code or other experts is played again, and none twice that differs in experts nobody asks.
    Progress goes to standard error. Raises `StorageError`.
    """
    played_as = {trial: trial.as_played for trial in trials}
    different = list(dict.fromkeys(played_as.values()))
    prints = {trial: fingerprint(trial.world, trial.pair, trial.method.approach.source()) for trial in different}
    done: dict[Trial, Outcome] = {}
    outdated = 0
    for trial in different:
        outcome = kept(trial, folder)
        if outcome is None:
            continue
        if outcome.fingerprint == prints[trial]:
            done[trial] = outcome
        else:
            outdated += 1
    if outdated:
        of_others = f"{plural(outdated, 'kept trial')} of other code or other experts"
        print(f"{of_others}: played again", file=sys.stderr, flush=True)
    missing = [trial for trial in different if trial not in done]
    with Bar(len(different), len(done)) as bar:
        for played in pool(missing) if missing else ():
            outcome = msgspec.structs.replace(played, fingerprint=prints[played.trial])
            keep(outcome, folder)
            done[outcome.trial] = outcome
            bar.note(outcome)
    return [msgspec.structs.replace(done[played_as[trial]], trial=trial) for trial in trials]


class Bar:
    """A bar on a terminal, else a line for every trial that ends."""

    def __init__(self, total: int, done: int) -> None:
        self._total, self._done = total, done
        self._bar = tqdm(total=total, initial=done, unit="trial", disable=not sys.stderr.isatty(), file=sys.stderr)

    def note(self, outcome: Outcome) -> None:
        """One more has ended."""
        self._done += 1
        self._bar.update()
        tqdm.write(f"[{self._done}/{self._total}] {line(outcome)}", file=sys.stderr)
        sys.stderr.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()


def line(outcome: Outcome) -> str:
    """How a trial ended, in one line."""
    trial, result = outcome.trial, outcome.result
    how = f"{'converged after' if result.converged else 'not converged in'} {plural(result.laps, 'lap')}"
    asked = f"{plural(result.human_labels, 'human label')}, {plural(result.interventions, 'intervention')}"
    return (
        f"{Path(trial.world).stem} {trial.method.name} {trial.teacher} seed {trial.seed}: {how}, "
        f"{asked}; {result.elapsed_s:.0f} s"
    )
