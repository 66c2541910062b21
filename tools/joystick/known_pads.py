"""What is learned about each pad, kept over sessions: $XDG_STATE_HOME/lira/pads.json."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta

from lira.hal.config import Table, load_json, write_whole
from lira.hal.errors import ConfigError, StorageError
from lira.tools.joystick.freeze import LONGEST_S, SHORTEST_S


class PadTraits(Table, frozen=True):
    """One pad. `timeout_s` is the silence that counts as a freeze."""

    timeout_s: Annotated[float, Meta(ge=SHORTEST_S, le=LONGEST_S)]


def state_file() -> Path:
    """Where it is kept, by the XDG base directories."""
    base = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(base) / "lira" / "pads.json"


class PadMemory:
    """Traits by pad. Without a file, or where it cannot be read or written, they last as long as the process.

    `say` gets a line when the file is of no use: a pad drives without it.
    """

    def __init__(self, path: Path | None, say: Callable[[str], None] = print) -> None:
        self._path = path
        self._say = say
        self._pads: dict[str, PadTraits] = {}
        if path is not None and path.exists():
            self._load(path)

    def timeout_s(self, pad: str) -> float | None:
        """What was learned about a pad earlier, if it was seen."""
        traits = self._pads.get(pad)
        return None if traits is None else traits.timeout_s

    def keep(self, pad: str, timeout_s: float) -> None:
        """Remember what was learned about a pad."""
        traits = PadTraits(round(timeout_s, 3))
        if self._pads.get(pad) == traits:
            return
        self._pads[pad] = traits
        if self._path is not None:
            try:
                write_whole(self._path, msgspec.json.format(msgspec.json.encode(self._pads)), folder=True)
            except StorageError as error:
                self._give_up(error.what)

    def _load(self, path: Path) -> None:
        try:
            self._pads = load_json(path, dict[str, PadTraits])
        except ConfigError as error:
            self._set_aside(path, error.what)

    def _set_aside(self, path: Path, why: str) -> None:
        """Begin anew, and keep what could not be read."""
        kept = path.with_name(f"{path.name}.damaged")
        try:
            path.replace(kept)
        except OSError:
            self._give_up(why)
        else:
            self._say(f"{why}; it is kept as {kept}, and what is learned about pads begins anew")

    def _give_up(self, why: str) -> None:
        self._path = None
        self._say(f"{why}; what is learned about pads is forgotten at the end")
