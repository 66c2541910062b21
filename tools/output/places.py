"""Where something is to be written, looked at before any work is done for it."""

from datetime import datetime
from itertools import count
from pathlib import Path

from lira.hal.errors import StorageError


def check_new(path: Path, *, folders: bool = False) -> None:
    """Raise `StorageError` for what is there already, or has no folder to be in: nothing is written over.

    `folders`: they are made where there are none.
    """
    check_folder(path.parent)
    if path.exists():
        raise StorageError(f"{path} is there already", "Choose another name: nothing is written over.")
    if not folders and not path.parent.exists():
        raise StorageError(f"cannot write {path}: there is no folder {path.parent}", "Make it, or choose another.")


def check_folder(path: Path) -> None:
    """Raise `StorageError` for what can be no folder: a file is there, or on the way to it."""
    there = next(each for each in (path, *path.absolute().parents) if each.exists())
    if not there.is_dir():
        raise StorageError(f"{path} can be no folder: {there} is a file", "Choose another folder.")


def own_folder(parent: Path, name: str = "") -> Path:
    """Make a folder in `parent` that is called by the name and by now; who begins in the same second gets another.

    Raises `StorageError`.
    """
    check_folder(parent)
    first = parent / f"{name}{datetime.now():%Y%m%d-%H%M%S}"
    path = first
    for number in count(2):
        if _make(path):
            break
        path = first.with_name(f"{first.name}_{number}")
    return path


def _make(path: Path) -> bool:
    try:
        path.mkdir(parents=True)
    except FileExistsError:
        return False
    except OSError as error:
        raise StorageError(f"cannot make {path}: {error.strerror}", "Choose another folder.") from error
    return True
