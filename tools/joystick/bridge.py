"""The bridge's loop: read the pad, let the hand decide, send, keep time. No step of it waits for the network."""

import math
import select
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from lira.hal.errors import DeviceError
from lira.hal.messages import Applied, Reason
from lira.tools.joystick.axes import PadState, unrest
from lira.tools.joystick.client import TeleopClient
from lira.tools.joystick.deadman import Hand, Order, State
from lira.tools.joystick.freeze import FreezeWatch
from lira.tools.joystick.known_pads import PadMemory
from lira.tools.joystick.pads.mapping import Mapping, load_mapping
from lira.tools.joystick.requests import RequestButtons
from lira.tools.joystick.rumble import PATTERNS, TAKEN, Rumble, pattern_of
from lira.tools.operator.situation import Urgency
from lira.tools.operator.view import View
from lira.tools.operator.voice import speak

RATE_HZ = 30.0
SEARCH_S = 0.3
STALL_S = 2.0 / RATE_HZ
PATIENCE_S = 1.0  # a pad that is not at rest for so long has something that keeps it from it
REST_REMEDY = (
    "Let go of it. If it stays so, the stick is worn: give it a larger dead_zone in a file of its own (--learn)"
)
WORDS = {
    State.LOCKED: "hands off: let go of the dead-man and centre the sticks to begin",
    State.READY: "ready: hold the dead-man to drive",
    State.DRIVING: "you drive",
    State.RESTING: "you gave control back",
    State.HOLDING: "stopped: the robot stands until a hand comes back",
}


class OpenPad(Protocol):
    """A pad that can be read; `tools.joystick.pad.Pad` is the real one."""

    name: str
    key: str
    state: PadState
    mapping: Mapping
    motion_trouble: str

    @property
    def has_motion(self) -> bool:
        """Whether it has motion sensors, so that it is never silent."""

    def fileno_list(self) -> list[int]:
        """What to wait for."""

    def read(self) -> tuple[list[PadState], bool]:
        """States after each report since the last call, and whether anything came; `DeviceError` when it is gone."""

    def rumble(self, strength: float) -> None:
        """Rumble at a strength in [0, 1] from now on."""

    def close(self) -> None:
        """Close it; it may be gone."""


class Bridge:
    """Connects one pad with one robot. `find` opens the pad when it is there; `say` gets a line now and then.

    `memory` keeps what is learned about each pad; `advice` says what to do while there is none.

    Raises what `find` raises if the pad that is there cannot be opened; once running it keeps trying instead.
    """

    def __init__(
        self,
        client: TeleopClient,
        find: Callable[[], OpenPad | None],
        memory: PadMemory,
        say: Callable[[str], None] = print,
        advice: Callable[[], str] = lambda: "no pad is there",
    ) -> None:
        self._client = client
        self._open_pad = find
        self._memory = memory
        self._say = say
        self._advice = advice
        self._use(load_mapping("ps3"))  # until there is a pad, which has its own
        self._rumble = Rumble()
        self._watch = FreezeWatch()
        self._awake_s = 0.0  # time without our own stalls: those are no silence of the pad
        self._looked_s = self._due_s = self._search_s = time.monotonic()
        self._pad: OpenPad | None = None
        self._locked_s = self._due_s  # since when the pad is not at rest
        self._sent = Order(None)
        self._view = View(client.robot)
        self._voice = speak(self._view)
        self._heard_s = self._decided_s = -math.inf
        self._urgency = Urgency.CALM
        self._last_words = ""
        self._find()
        if self._pad is None:
            self._tell(self._advice())

    @property
    def hand(self) -> State:
        """How the dead-man is."""
        return self._hand.state

    @property
    def pad(self) -> str:
        """Name of the pad; "" while there is none."""
        return "" if self._pad is None else self._pad.name

    def run(self, stop: threading.Event, alive: Callable[[], None] = lambda: None) -> None:
        """Go on until `stop` is set; then let the robot stand if a hand was on the controls.

        `alive` is called with every turn.
        """
        try:
            while not stop.is_set():
                alive()
                self._step()
        finally:
            if self._sent.action is not None:
                self._client.drive((0.0, 0.0), self._sent.released, time.monotonic())
            if self._pad is not None:
                self._remember(self._pad)
                self._pad.close()

    def _use(self, mapping: Mapping) -> None:
        """Follow a pad of this layout from now on, from the beginning."""
        self._mapping = mapping
        self._hand = Hand(mapping)
        self._buttons = RequestButtons(mapping)

    def _step(self) -> None:
        self._wait()
        states = self._read()
        now_s = time.monotonic()
        for state in states:
            self._order(state, now_s)
        if now_s >= self._due_s:
            self._due_s = max(self._due_s + 1.0 / RATE_HZ, now_s)
            self._tick(now_s)

    def _wait(self) -> None:
        """Until the pad says something, or the next tick is due."""
        left_s = max(0.0, self._due_s - time.monotonic())
        select.select([] if self._pad is None else self._pad.fileno_list(), [], [], left_s)
        now_s = time.monotonic()
        self._awake_s += min(now_s - self._looked_s, STALL_S)
        self._looked_s = now_s

    def _read(self) -> list[PadState]:
        if self._pad is None:
            return []
        try:
            states, heard = self._pad.read()
        except DeviceError as error:
            self._lose(error.what)
            return []
        if heard:
            new = self._watch.learned_s is None
            self._watch.note(self._awake_s)
            if new:
                self._remember(self._pad)
        return states

    def _tick(self, now_s: float) -> None:
        applied = self._client.listen()
        if self._pad is None and now_s >= self._search_s:
            self._search()
        if self._hand.state is not State.LOCKED or self._pad is None:
            self._locked_s = now_s
        elif now_s - self._locked_s >= PATIENCE_S:
            self._say_what_moves(self._pad.state)
        self._order(None if self._pad is None else self._pad.state, now_s, tick=True)
        if self._pad is not None and self._is_alive():
            self._client.show(*_joy(self._pad.state, self._mapping), now_s)
        self._look(applied, now_s)
        self._feel(now_s)
        self._hear(now_s)

    def _order(self, state: PadState | None, now_s: float, *, tick: bool = False) -> None:
        """Let the hand decide. What changes who drives goes out at once, the rest at the tick."""
        before = self._hand.state
        watched = before in (State.DRIVING, State.LOCKED)
        order = self._hand.update(state, now_s, not watched or self._is_alive())
        if order.estop is not None:
            self._client.estop(order.estop)
        pressed = state if self._is_alive() else None
        client = self._client
        for request in self._buttons.update(pressed, now_s, paused=client.paused, experts=client.experts):
            client.ask(request, now_s)
        changed = self._hand.state is not before
        if order.action is not None and (tick or changed):
            self._client.drive(order.action, order.released, now_s)
        self._sent = order
        if changed:
            if before is State.DRIVING and state is not None and not self._is_alive():
                self._tell("the pad is frozen: it is connected and silent")
            self._tell(WORDS[self._hand.state])

    def _is_alive(self) -> bool:
        """Whether the pad talks as a live one does; taken for granted where it cannot be told."""
        if not self._mapping.freeze or self._pad is None or not self._pad.has_motion:
            return True
        return self._watch.is_alive(self._awake_s)

    def _search(self) -> None:
        self._search_s = time.monotonic() + SEARCH_S
        try:
            self._find()
        except DeviceError as error:
            self._tell(str(error))

    def _find(self) -> None:
        self._pad = self._open_pad()
        if self._pad is None:
            return
        if self._pad.mapping != self._mapping:
            self._use(self._pad.mapping)
        self._watch = FreezeWatch(self._memory.timeout_s(self._pad.key))
        motion = ", with motion sensors" if self._pad.has_motion else ""
        self._tell(f"pad: {self._pad.name}{motion}, layout {self._mapping.name}")
        if self._pad.motion_trouble:
            self._tell(f"{self._pad.motion_trouble} Nobody will notice if it freezes.")
        elif self._mapping.freeze and not self._pad.has_motion:
            self._tell("its motion sensors are not there, so nobody will notice if it freezes")
        self._tell(layout_words(self._mapping))

    def _say_what_moves(self, state: PadState) -> None:
        """Name what keeps the pad from being at rest. It drives nothing meanwhile."""
        if held := unrest(state, self._mapping):
            names = [words.split()[0] for words in held]
            self._tell(f"not at rest: {', '.join(held)}. {REST_REMEDY}", key=f"not at rest: {names}")

    def _lose(self, why: str) -> None:
        assert self._pad is not None
        self._remember(self._pad)
        self._pad.close()
        self._pad = None
        self._tell(why)
        self._order(None, time.monotonic(), tick=True)

    def _remember(self, pad: OpenPad) -> None:
        """Keep what was learned about how long this pad is silent, if it is never silent for long."""
        if pad.has_motion and self._watch.learned_s is not None:
            self._memory.keep(pad.key, self._watch.learned_s)

    def _hear(self, now_s: float) -> None:
        """Pass on what was answered to requests."""
        for answer in self._client.answers():
            self._say(f"learner: {answer.words}")
            if answer.accepted:
                self._rumble.play(TAKEN, now_s)
        if (request := self._client.unanswered(now_s)) is not None:
            self._say(f"nobody answers to '{request}': does lira fusion run?")

    def _feel(self, now_s: float) -> None:
        """Rumble for what was asked on `joy/feedback`, and for whatever needs the person as it begins."""
        for message in self._client.feedback():
            self._rumble.play(pattern_of(message), now_s)
        if self._voice.urgency is not self._urgency and self._voice.urgency in PATTERNS:
            self._rumble.play(PATTERNS[self._voice.urgency], now_s)
        self._urgency = self._voice.urgency
        if self._pad is not None:
            self._pad.rumble(self._rumble.strength(now_s) or 0.0)

    def _look(self, applied: Applied | None, now_s: float) -> None:
        """Bring up to date what is known, and say what to do when that becomes something else."""
        decisions, newest = self._client.decisions(), applied or self._view.applied
        if applied is not None:
            self._heard_s = now_s
        if decisions:
            self._decided_s = now_s
        self._view = replace(
            self._view,
            applied=newest,
            link_age_s=now_s - self._heard_s,
            decision=decisions[-1] if decisions else self._view.decision,
            decision_age_s=now_s - self._decided_s,
            session=self._client.session,
            session_age_s=now_s - self._client.session_s,
            answer=self._client.answer,
            answer_age_s=now_s - self._client.answered_s,
            estop=newest is not None and newest.reason is Reason.ESTOP,
            confirmed=self._client.confirmed,
            hand=self._hand.state,
        )
        before, self._voice = self._voice, speak(self._view)
        if self._voice.situation is not before.situation and self._voice.urgency in PATTERNS:
            self._tell(f"{self._voice.who}: {self._voice.why} {self._voice.now}")

    def _tell(self, words: str, key: str = "") -> None:
        """Say something, once; what has the same `key` as what was said last is the same."""
        if (key or words) != self._last_words:
            self._say(words)
        self._last_words = key or words


def layout_words(mapping: Mapping) -> str:
    """Which control is what on this pad, in a line."""
    asks = [(name, getattr(mapping, name)) for name in ("pause", "save", "reset", "prove", "undo")]
    words = [f"dead-man {mapping.dead_man}", f"turbo {mapping.turbo}", f"emergency stop {' or '.join(mapping.estop)}"]
    words += [f"release {mapping.release}", *(f"{what} {name}" for what, name in asks if name)]
    return "its controls: " + ", ".join(words)


def _joy(state: PadState, mapping: Mapping) -> tuple[tuple[float, ...], tuple[int, ...]]:
    """Axes with up and left positive, as ROS has them, and buttons."""
    return tuple(-state.reads(name) for name in mapping.axes), tuple(int(state.holds(name)) for name in mapping.buttons)
