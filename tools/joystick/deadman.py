"""The person's hand: when it drives, when it lets go, and what then. Pure: the time is handed in.

| state | sends on `cmd_vel/teleop` | leaves it when |
|---|---|---|
| locked | nothing | the dead-man is up and the sticks rest |
| ready | nothing | the dead-man is pressed |
| driving | the sticks | the dead-man is let go, the pad is lost, or the emergency stop is pressed |
| resting | zeros that give control back | 0.5 s are over: one zero may be lost |
| holding | zeros that do not give it back | 0.5 s are over, then silence: the robot stands until a hand comes back |
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

from lira.hal.messages import Action
from lira.tools.joystick.axes import PadState, action_of
from lira.tools.joystick.pads.mapping import Mapping

ZEROS_S = 0.5
RELEASE_S = 1.0
ZERO: Action = (0.0, 0.0)


class State(StrEnum):
    """Where the hand is."""

    LOCKED = "locked"
    READY = "ready"
    DRIVING = "driving"
    RESTING = "resting"
    HOLDING = "holding"


class Event(StrEnum):
    """What can happen to it."""

    LOST = "lost"  # the pad is gone or frozen
    STOP = "stop"  # the emergency stop is pressed
    GRIP = "grip"  # the dead-man is held
    LET_GO = "let go"  # the dead-man is up
    NEUTRAL = "neutral"  # the dead-man is up and the sticks rest
    TIME = "time"  # the zeros have lasted long enough


_L, _Y, _D, _R, _H = State.LOCKED, State.READY, State.DRIVING, State.RESTING, State.HOLDING
TRANSITIONS: dict[tuple[State, Event], State] = {
    (_L, Event.LOST): _L,
    (_L, Event.STOP): _L,
    (_L, Event.GRIP): _L,
    (_L, Event.LET_GO): _L,
    (_L, Event.NEUTRAL): _Y,
    (_L, Event.TIME): _L,
    (_Y, Event.LOST): _L,
    (_Y, Event.STOP): _L,
    (_Y, Event.GRIP): _D,
    (_Y, Event.LET_GO): _Y,
    (_Y, Event.NEUTRAL): _Y,
    (_Y, Event.TIME): _Y,
    (_D, Event.LOST): _H,
    (_D, Event.STOP): _H,
    (_D, Event.GRIP): _D,
    (_D, Event.LET_GO): _R,
    (_D, Event.NEUTRAL): _R,
    (_D, Event.TIME): _D,
    (_R, Event.LOST): _R,
    (_R, Event.STOP): _H,
    (_R, Event.GRIP): _D,
    (_R, Event.LET_GO): _R,
    (_R, Event.NEUTRAL): _R,
    (_R, Event.TIME): _L,
    (_H, Event.LOST): _H,
    (_H, Event.STOP): _H,
    (_H, Event.GRIP): _H,
    (_H, Event.LET_GO): _H,
    (_H, Event.NEUTRAL): _H,
    (_H, Event.TIME): _L,
}


@dataclass(frozen=True, slots=True)
class Order:
    """What to send now: an action (None: nothing), whether it gives control back, and the emergency stop.

    `estop` is True at a press, False at a release, None otherwise.
    """

    action: Action | None
    released: bool = False
    estop: bool | None = None


class Hand:
    """Follows a pad. Call `update` after every report of the pad, and at least at the rate of the commands."""

    def __init__(self, mapping: Mapping) -> None:
        self._mapping = mapping
        self._state = State.LOCKED
        self._since_s = 0.0
        self._is_there = False
        self._stop_held = False
        self._release_since_s: float | None = None

    @property
    def state(self) -> State:
        """Where the hand is."""
        return self._state

    def update(self, pad: PadState | None, now_s: float, alive: bool = True) -> Order:
        """Take the pad's state in (None: it is gone; not `alive`: it is frozen) and return what to send.

        The emergency stop is obeyed from any pad that still says something.
        """
        estop = self._estop(pad, now_s)
        for event in self._events(pad if alive else None, estop, now_s):
            self._fire(event, now_s)
        if self._state is State.DRIVING and pad is not None:
            return Order(action_of(pad, self._mapping), estop=estop)
        if self._state in (State.RESTING, State.HOLDING):
            return Order(ZERO, self._state is State.RESTING, estop)
        return Order(None, estop=estop)

    def _fire(self, event: Event, now_s: float) -> None:
        before, self._state = self._state, TRANSITIONS[self._state, event]
        if self._state is not before:
            self._since_s = now_s

    def _events(self, pad: PadState | None, estop: bool | None, now_s: float) -> Iterator[Event]:
        if self._state in (State.RESTING, State.HOLDING) and now_s - self._since_s >= ZEROS_S:
            yield Event.TIME
        if estop:
            yield Event.STOP
        if pad is None:
            yield Event.LOST
        elif pad.holds(self._mapping.dead_man):
            yield Event.GRIP
        elif action_of(pad, self._mapping) == ZERO:
            yield Event.NEUTRAL
        else:
            yield Event.LET_GO

    def _estop(self, pad: PadState | None, now_s: float) -> bool | None:
        """The edge of a press, or of a release that has been held long enough with the hand off the controls."""
        held = pad is not None and any(pad.holds(name) for name in self._mapping.estop)
        # PS also switches a pad on: one that comes with it held has not been asked to stop.
        pressed = held and not self._stop_held and self._is_there
        self._stop_held, self._is_there = held, pad is not None
        if pressed:
            self._release_since_s = None
            return True
        releasing = pad is not None and pad.holds(self._mapping.release) and not held
        if not releasing or self._state not in (State.LOCKED, State.READY):
            self._release_since_s = None
        elif self._release_since_s is None:
            self._release_since_s = now_s
        elif now_s - self._release_since_s >= RELEASE_S:
            self._release_since_s = float("inf")  # once for each time it is held
            return False
        return None
