"""Outcomes on disk, one file each."""

import os
from pathlib import Path

import msgspec

from hal.errors import StorageError
from tools.experiments.trial import Outcome, Trial


def kept(trial: Trial, folder: Path) -> Outcome | None:
    """Read what came of a trial, whoever played it and with which code; None if the folder has nothing of it.

    Raises `StorageError` for a file that is damaged.
    """
    path = folder / trial.file
    if not path.exists():
        return None
    try:
        return msgspec.json.decode(path.read_bytes(), type=Outcome)
    except (OSError, msgspec.MsgspecError) as error:
        raise StorageError(
            f"{path} is not the outcome of a trial: {error}", "Delete it to run the trial again."
        ) from error


def keep(outcome: Outcome, folder: Path) -> None:
    """Write an outcome whole or not at all. Raises `StorageError`."""
    path = folder / outcome.trial.file
    draft = path.with_suffix(f".{os.getpid()}.tmp")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        draft.write_bytes(msgspec.json.encode(outcome))
        draft.replace(path)
    except OSError as error:
        raise StorageError(
            f"cannot write {path}: {error.strerror}", "Free some space or choose another folder."
        ) from error
