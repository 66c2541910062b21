"""Typed configuration: a TOML file becomes a frozen struct, or an error that names the file, the key and the remedy."""

import tomllib
from pathlib import Path
from typing import TypeVar

import msgspec

from hal.errors import ConfigError

T = TypeVar("T")


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of every table in a configuration file: frozen, and an unknown key is an error."""


def load_toml(path: Path, kind: type[T]) -> T:
    """Read a TOML file into `kind`.

    Raises `ConfigError` for a file that cannot be read, is not TOML, or does not fit `kind`.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"cannot read {path}: {error}", "Check the path and that it is a text file.") from error
    return parse_toml(text, kind, str(path))


def parse_toml(text: str, kind: type[T], where: str) -> T:
    """Turn TOML text into `kind`; `where` names its origin in errors. Raises `ConfigError`."""
    try:
        return msgspec.convert(tomllib.loads(text), kind)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{where} is not valid TOML: {error}", "Mend the line it names.") from error
    except (msgspec.ValidationError, ValueError) as error:
        # msgspec ends its message with the place, e.g. "- at `$.line.width_m`".
        message = str(error).replace("Object contains unknown field", "unknown key").replace("`$.", "`")
        raise ConfigError(
            f"{where}: {message}", "Compare the file with the ones that come with the project."
        ) from error
