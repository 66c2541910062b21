"""Where something is to be written, looked at before any work is done for it."""

from pathlib import Path

from lira.hal.errors import StorageError


def check_folder(path: Path) -> None:
    """Raise `StorageError` for what can be no folder: a file is there, or on the way to it."""
    there = next(each for each in (path, *path.absolute().parents) if each.exists())
    if not there.is_dir():
        raise StorageError(f"{path} can be no folder: {there} is a file", "Choose another folder.")
