"""Calls of the board's service `config`: one after the other, each repeated until the board has answered it."""

import math
from collections.abc import Callable

AGAIN_S = 0.2  # an answer takes milliseconds: after this long the call or the answer was lost


class Errands:
    """What the board still has to be told. Pure; the time comes in.

    An answer does not say which call it belongs to, so there is never more than one under way.
    """

    def __init__(self) -> None:
        self._waiting: dict[str, str] = {}
        self._under_way: tuple[str, str] | None = None
        self._again_s = self._first_s = -math.inf

    def forget(self) -> None:
        """Nothing has to be told any more."""
        self._waiting.clear()
        self._under_way = None

    def want(self, command: str, data: str) -> None:
        """Have a command called; what it was to be called with before no longer counts."""
        self._waiting[command] = data

    def answered(self) -> str:
        """The board has answered the call that is under way; returns its command, "" if there was none.

        Where a call was repeated its second answer is taken for that of the next one.
        """
        call, self._under_way = self._under_way, None
        if call is None:
            return ""
        if call in self._waiting.items():
            del self._waiting[call[0]]
        return call[0]

    def due(self, now_s: float, encode: Callable[[str, str], bytes]) -> bytes:
        """Return the frame that has to go out now; nothing while an answer may still come."""
        if not self._waiting or (self._under_way is not None and now_s < self._again_s):
            return b""
        if self._under_way is None:
            self._first_s = now_s
        self._under_way, self._again_s = next(iter(self._waiting.items())), now_s + AGAIN_S
        return encode(*self._under_way)

    def unanswered_s(self, now_s: float) -> float:
        """For how long the board has been called without an answer."""
        return 0.0 if self._under_way is None else now_s - self._first_s
