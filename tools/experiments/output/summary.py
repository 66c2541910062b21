"""What is kept of an experiment in the repository: a small JSON file, from which RESULTS.md is made."""

import subprocess
from collections.abc import Sequence
from pathlib import Path

import msgspec

from lira.hal.config import load_json, write_whole
from lira.hal.errors import ConfigError, StorageError
from lira.tools.experiments.experiment import Experiment, Finding, Outcomes, Row, Table
from lira.tools.experiments.playing.fingerprint import ROOT

MOST_BYTES = 2**24


class Summary(msgspec.Struct, frozen=True, omit_defaults=True):
    """An experiment's numbers. `results` are the rows of its first table, `ratios` empty where nothing is paired.
    `quality` and `curves` are there where an experiment tells how good the novices are on layouts they have not seen.

    `fingerprints` says with which code and experts the trials were played: one for each pair of experts; `commit`, ""
    outside a clone, on what it was summarised.
    """

    name: str
    words: str
    command: str
    seeds: int
    trials: int
    machine_s: float
    fingerprints: list[str]
    results: list[Row]
    ratios: list[Row]
    tables: list[Table]
    findings: list[Finding]
    quality: list[Row] = []
    curves: list[Row] = []
    commit: str = ""


def summarise(name: str, words: str, command: str, seeds: int, experiment: Experiment, outcomes: Outcomes) -> Summary:
    """Reduce outcomes to what is kept."""
    tables = experiment.tables(outcomes)
    return Summary(
        name=name,
        words=words,
        command=command,
        seeds=seeds,
        trials=len(outcomes),
        machine_s=round(sum(outcome.result.elapsed_s for outcome in outcomes), 1),
        fingerprints=sorted({outcome.fingerprint for outcome in outcomes}),
        results=tables[0].rows,
        ratios=experiment.ratios(outcomes),
        tables=tables,
        findings=experiment.findings(outcomes),
        quality=experiment.quality(outcomes),
        curves=experiment.curves(outcomes),
        commit=commit(),
    )


def commit() -> str:
    """Return the commit of this clone, "" where there is none."""
    asked = ["git", "-C", str(ROOT), "rev-parse", "--short=7", "HEAD"]
    try:
        return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def to_json(summary: Summary) -> str:
    """Write it in a form that differs little from run to run: one field per line."""
    return msgspec.json.format(msgspec.json.encode(summary), indent=2).decode()


def write_summary(path: Path, summary: Summary) -> None:
    """Write it, and the folder where there is none yet. Raises `StorageError`."""
    write_whole(path, (to_json(summary) + "\n").encode(), folder=True)


def read_summary(path: Path) -> Summary:
    """Read what `to_json` wrote. Raises `StorageError`."""
    try:
        return load_json(path, Summary, MOST_BYTES)
    except ConfigError as error:
        raise StorageError(
            f"{path} is not the summary of an experiment: {error.what}", "Make it again with 'lira experiment'."
        ) from error


def read_summaries(folder: Path, names: Sequence[str]) -> list[Summary]:
    """Read those of the named experiments that the folder has, in the order of the names.

    After each come those of the same experiment elsewhere: NAME-WHERE.json.
    """
    paths = [path for name in names for path in (folder / f"{name}.json", *sorted(folder.glob(f"{name}-*.json")))]
    return [read_summary(path) for path in paths if path.exists()]
