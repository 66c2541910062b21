"""Runs trials side by side and says how far it is. What is done is kept: run it again to go on."""

import sys
from collections.abc import Sequence
from pathlib import Path

from joblib import Parallel, delayed

from tools.experiments.trial import Outcome, Trial, run_trial


def run_trials(trials: Sequence[Trial], folder: Path, workers: int) -> list[Outcome]:
    """Run the trials on `workers` processes, in order; progress goes to standard error."""
    running = Parallel(n_jobs=workers, return_as="generator")(delayed(run_trial)(trial, folder) for trial in trials)
    outcomes: list[Outcome] = []
    for outcome in running:
        outcomes.append(outcome)
        trial, result = outcome.trial, outcome.result
        how = f"converged after {result.laps} laps" if result.converged else f"not converged in {result.laps} laps"
        print(
            f"[{len(outcomes)}/{len(trials)}] {trial.world} {trial.method.name} seed {trial.seed}: {how}, "
            f"{result.human_labels} human labels, {result.interventions} interventions",
            file=sys.stderr,
            flush=True,
        )
    return outcomes
