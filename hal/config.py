"""Typed configuration: a TOML file becomes a frozen struct, or an error that names the file, the key and the remedy.

Every file that somebody else may have written is read through here: a regular file, of a bounded size.
"""

import errno
import os
import stat
import tomllib
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, TypeVar

import msgspec

from lira.hal.errors import ConfigError, StorageError
from lira.hal.misfit import COMPARE, misfit

T = TypeVar("T")
MOST_BYTES = 2**20  # a hundred times the longest that comes with the project
MOST_DOTS = 5000  # in a line of TOML, whose parser takes minutes for a key of so many parts
# What decoding raises for text that is not what it should be. Deep nesting ends at Python's limit of recursion.
MALFORMED = (msgspec.MsgspecError, ValueError, OverflowError, RecursionError)


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of every table in a configuration file: frozen, and an unknown key is an error."""


def open_regular(path: Path) -> BinaryIO:
    """Open a file for reading. Raises `OSError`, also for a pipe or a device, which may have no end."""
    file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)  # nobody waits for the other end of a pipe
    mode = os.fstat(file).st_mode
    if not stat.S_ISREG(mode):
        os.close(file)
        number = errno.EISDIR if stat.S_ISDIR(mode) else errno.EINVAL
        raise OSError(number, os.strerror(number) if stat.S_ISDIR(mode) else "it is a pipe or a device")
    return os.fdopen(file, "rb")


def read_bounded(path: Path, most: int = MOST_BYTES) -> bytes:
    """Read a whole file. Raises `ConfigError` for one that cannot be read or has more than `most` bytes."""
    try:
        with open_regular(path) as file:
            data = file.read(most + 1)
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror}", "Check the path.") from error
    if len(data) > most:
        raise ConfigError(f"{path} has more than {most} bytes", "Check that it is the right file.")
    return data


def load_toml(path: Path, kind: type[T]) -> T:
    """Read a TOML file into `kind`.

    Raises `ConfigError` for a file that cannot be read, is not TOML, or does not fit `kind`.
    """
    try:
        text = read_bounded(path).decode()
    except UnicodeDecodeError as error:
        raise ConfigError(f"cannot read {path}: {error}", "Check that it is a text file.") from error
    return parse_toml(text, kind, str(path))


def parse_toml(text: str, kind: type[T], where: str) -> T:
    """Turn TOML text into `kind`; `where` names its origin in errors. Raises `ConfigError`."""
    if any(line.count(".") > MOST_DOTS for line in text.splitlines()):
        raise ConfigError(f"{where} has a line with more than {MOST_DOTS} dots", COMPARE)
    try:
        return msgspec.convert(tomllib.loads(text), kind)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{where} is not valid TOML: {error}", "Mend the line it names.") from error
    except RecursionError as error:
        raise ConfigError(f"{where} is nested too deeply", COMPARE) from error
    except MALFORMED as error:
        raise misfit(error, kind, where) from error


def load_json(path: Path, kind: type[T], most: int = MOST_BYTES) -> T:
    """Read a JSON file into `kind`. Raises `ConfigError` as `load_toml` does."""
    try:
        return msgspec.json.decode(read_bounded(path, most), type=kind)
    except RecursionError as error:
        raise ConfigError(f"{path} is nested too deeply", COMPARE) from error
    except MALFORMED as error:
        raise misfit(error, kind, str(path)) from error


def write_whole(path: Path, data: bytes, *, folder: bool = False) -> None:
    """Put a file in its place whole, and on the disk itself, or leave what is there. Raises `StorageError`.

    A link stays one, and a device or a pipe is written to as it is. `folder`: make it where there is none.
    """
    whole = Path(os.path.realpath(path))
    draft = whole.with_name(f"{whole.name}.{os.getpid()}.tmp")
    try:
        if folder:
            whole.parent.mkdir(parents=True, exist_ok=True)
        if whole.exists() and not whole.is_file():
            whole.write_bytes(data)
            return
        with draft.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        draft.replace(whole)
    except OSError as error:
        with suppress(OSError):
            draft.unlink()
        what = f"cannot write {path}: {error.strerror}"
        raise StorageError(what, "Free some space or choose another place.") from error
