"""Outcomes on disk, one file each."""

from pathlib import Path

import msgspec

from lira.hal.config import load_json, write_whole
from lira.hal.errors import ConfigError, StorageError
from lira.tools.experiments.trial import Outcome, Trial

MOST_BYTES = 2**28  # an outcome holds the way of the robot


def kept(trial: Trial, folder: Path) -> Outcome | None:
    """Read what came of a trial, whoever played it and with which code; None if the folder has nothing of it.

    Raises `StorageError` for a file that is damaged.
    """
    path = folder / trial.file
    if not path.exists():
        return None
    try:
        return load_json(path, Outcome, MOST_BYTES)
    except ConfigError as error:
        raise StorageError(
            f"{path} is not the outcome of a trial: {error.what}", "Delete it to run the trial again."
        ) from error


def keep(outcome: Outcome, folder: Path) -> None:
    """Write an outcome whole or not at all. Raises `StorageError`."""
    write_whole(folder / outcome.trial.file, msgspec.json.encode(outcome), folder=True)
