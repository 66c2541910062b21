"""Buttons that ask something of whoever drives and learns. Pure: the time is handed in."""

import math
from collections.abc import Iterator, Sequence

from lira.hal.messages import OperatorRequest, Request
from lira.tools.joystick.axes import PadState
from lira.tools.joystick.pads.mapping import Mapping

HOLD_S = 1.0  # so long for what cannot be taken back


class RequestButtons:
    """Follows a pad. Call `update` after every report of the pad and at every tick, as for the hand."""

    def __init__(self, mapping: Mapping) -> None:
        self._mapping = mapping
        self._buttons = [name for name in mapping.asking if name] + [*mapping.experts]
        self._since_s: dict[str, float] | None = None  # of what is pressed; inf once it has been asked

    def update(
        self, pad: PadState | None, now_s: float, *, paused: bool, experts: Sequence[str]
    ) -> list[OperatorRequest]:
        """Take the pad's state in (None: it is gone or frozen) and return what is asked now.

        `paused` is what a press of pause ends, `experts` who gets control, in the order of the buttons. A button that
        is pressed while the pad comes asks nothing.
        """
        if pad is None:
            self._since_s = None
            return []
        pressed = [name for name in self._buttons if pad.holds(name)]
        before, start_s = ({}, math.inf) if self._since_s is None else (self._since_s, now_s)
        self._since_s = {name: before.get(name, start_s) for name in pressed}
        return [self._request(name, paused, experts) for name in self._due(now_s)]

    def _due(self, now_s: float) -> Iterator[str]:
        assert self._since_s is not None
        for name, since_s in self._since_s.items():
            if now_s - since_s >= (HOLD_S if name in (self._mapping.reset, self._mapping.undo) else 0.0):
                self._since_s[name] = math.inf
                yield name

    def _request(self, name: str, paused: bool, experts: Sequence[str]) -> OperatorRequest:
        mapping = self._mapping
        if name == mapping.pause:
            return OperatorRequest(Request.RESUME if paused else Request.PAUSE)
        asks = {
            mapping.reset: Request.RESET,
            mapping.save: Request.SAVE,
            mapping.prove: Request.PROVE,
            mapping.undo: Request.UNDO,
        }
        if name in asks:
            return OperatorRequest(asks[name])
        index = mapping.experts.index(name)
        return OperatorRequest(Request.HANDOVER, experts[index] if index < len(experts) else f"expert {index + 1}")
