"""Who drives from the page, and whether that page still lives. Pure: times come in as arguments, in seconds.

A browser hides, sleeps, loses its network, or hangs, and says nothing of it. So a page that drives says what its
controls are 25 times a second, and with it the time of the newest frame that it has seen: what was said too long ago,
or in answer to something old, is not obeyed. With the time-out of the robot the wheels have zero within 0.35 s.
"""

import threading
from enum import StrEnum
from typing import Annotated

import msgspec
from msgspec import Meta

from lira.tools.joystick.axes import AxisRange, PadState
from lira.tools.joystick.pads.codes import AXES, BUTTONS
from lira.tools.joystick.pads.mapping import Mapping, load_mapping

SILENT_S = 0.12  # three words that did not come
OLDEST_S = 0.15  # between a frame and a word that answers it; what is older came over a link that holds things up
IDLE_S = 20.0  # so long without the dead-man, and the seat may be taken by another page
FULL = 1000

Axis = Annotated[float, Meta(ge=-1.0, le=1.0)]
Client = int
"""A page that is connected; numbers are never used twice."""


class Control(StrEnum):
    """A button of the page, of the keyboard or of a pad in the browser."""

    DEAD_MAN = "dead_man"
    TURBO = "turbo"
    ESTOP = "estop"
    RELEASE = "release"
    PAUSE = "pause"
    RESET = "reset"
    SAVE = "save"
    PROVE = "prove"
    UNDO = "undo"
    EXPERT_1 = "expert_1"
    EXPERT_2 = "expert_2"
    EXPERT_3 = "expert_3"
    EXPERT_4 = "expert_4"


class Input(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the controls of a page are. `forward` and `turn` (left positive) are in [-1, 1].

    `seen` is the time of the newest frame that the page has seen. `away`: it is hidden or has lost the focus.
    """

    seen: float
    forward: Axis = 0.0
    turn: Axis = 0.0
    held: Annotated[tuple[Control, ...], Meta(max_length=len(Control))] = ()
    away: bool = False


def page_mapping() -> Mapping:
    """The pad that a page is: the built-in one, but nothing is known of how long it may be silent."""
    return msgspec.structs.replace(load_mapping("ps3"), name="page", freeze=False)


def pad_of(said: Input, mapping: Mapping) -> PadState:
    """The pad that a page's controls stand for."""
    experts = dict(
        zip((Control.EXPERT_1, Control.EXPERT_2, Control.EXPERT_3, Control.EXPERT_4), mapping.experts, strict=True)
    )
    buttons = {
        Control.DEAD_MAN: mapping.dead_man,
        Control.TURBO: mapping.turbo,
        Control.ESTOP: mapping.estop[0],
        Control.RELEASE: mapping.release,
        Control.PAUSE: mapping.pause,
        Control.RESET: mapping.reset,
        Control.SAVE: mapping.save,
        Control.PROVE: mapping.prove,
        Control.UNDO: mapping.undo,
        **experts,
    }
    sticks = ((mapping.forward, said.forward), (mapping.turn, said.turn))
    axes = {AXES[axis.axis]: round(FULL * (-value if axis.inverted else value)) for axis, value in sticks}
    pressed = frozenset(BUTTONS[name] for control in said.held if (name := buttons[control]) is not None)
    return PadState({code: AxisRange(-FULL, FULL) for code in axes}, axes, pressed)


class Seat:
    """One driver at a time. Pages come by the thread of the server, the bridge looks from its own."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._holder: Client | None = None
        self._said: list[Input] = []
        self._heard_s = self._gripped_s = float("-inf")
        self._broken = False  # there was a gap that the bridge has not seen yet

    def take(self, client: Client, now_s: float) -> bool:
        """Sit down, if the seat is free or whoever has it does nothing. Returns whether the client has it now."""
        with self._lock:
            if self._holder is not None and self._holder != client and not self._is_idle(now_s):
                return False
            if self._holder != client:
                self._holder, self._said, self._broken = client, [], False
                self._heard_s, self._gripped_s = float("-inf"), now_s
            return True

    def leave(self, client: Client) -> None:
        """Get up, if the client has the seat: its page is gone."""
        with self._lock:
            if self._holder == client:
                self._holder, self._said = None, []

    def hear(self, client: Client, said: Input, now_s: float) -> None:
        """Take in what a page says. Nothing of a page without the seat, nor of one that is away or late."""
        with self._lock:
            if self._holder != client:
                return
            if self._heard_s < now_s - SILENT_S:
                self._broken = True  # what comes after a gap does not mend it
            if said.away or not 0.0 <= now_s - said.seen <= OLDEST_S:
                self._heard_s, self._broken = float("-inf"), True
                return
            self._heard_s = now_s
            self._said.append(said)
            if Control.DEAD_MAN in said.held:
                self._gripped_s = now_s

    def take_said(self) -> list[Input]:
        """What was said since the last time."""
        with self._lock:
            said, self._said = self._said, []
            return said

    def take_break(self) -> bool:
        """Whether there was a gap since the last time: a hand that was on the controls is off."""
        with self._lock:
            broken, self._broken = self._broken, False
            return broken

    def holder(self) -> Client | None:
        """Who has the seat."""
        with self._lock:
            return self._holder

    def alive(self, now_s: float) -> bool:
        """Whether somebody has the seat whose page still lives."""
        with self._lock:
            return self._holder is not None and now_s - self._heard_s <= SILENT_S

    def state(self, client: Client, now_s: float) -> str:
        """How the seat looks to a client: "yours", "free" or "taken"."""
        with self._lock:
            if self._holder == client:
                return "yours"
            return "free" if self._holder is None or self._is_idle(now_s) else "taken"

    def _is_idle(self, now_s: float) -> bool:
        return now_s - self._gripped_s > IDLE_S
