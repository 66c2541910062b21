"""What is learned about each pad, kept over sessions: $XDG_STATE_HOME/lira/pads.json."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta

from hal.config import Table
from tools.joystick.freeze import LONGEST_S, SHORTEST_S


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
                self._save(self._path)
            except OSError as error:
                self._give_up(f"cannot write {self._path}: {error.strerror}")

    def _load(self, path: Path) -> None:
        try:
            self._pads = msgspec.json.decode(path.read_bytes(), type=dict[str, PadTraits])
        except OSError as error:
            self._give_up(f"cannot read {path}: {error.strerror}")
        except (msgspec.MsgspecError, ValueError) as error:
            self._say(f"{path} is not understood and will be written anew: {error}")

    def _save(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_name(f"{path.name}.{os.getpid()}.tmp")
        draft.write_bytes(msgspec.json.format(msgspec.json.encode(self._pads)))
        draft.replace(path)

    def _give_up(self, why: str) -> None:
        self._path = None
        self._say(f"{why}; what is learned about pads is forgotten at the end")
