"""The fingers of a scripted person: what it wants to do becomes sticks and buttons, of a pad or of a page."""

import bisect
import threading
import time

from lira.hal.bus.topics import APPLIED, SESSION
from lira.hal.messages import Request
from lira.tools.joystick.axes import shape
from lira.tools.joystick.pads.mapping import load_mapping
from lira.tools.live.requests import TAUGHT
from lira.tools.live.scripted_person import STOPPED

RATE_HZ = 30.0
PRESS_S = 0.2
LOOK_S = 2.0  # after so long in vain the dead-man is pressed once more
PS3 = load_mapping("ps3")
WAYS = [way / 200 for way in range(201)]
BENT = [shape(way, PS3.dead_zone, PS3.expo) for way in WAYS]


def deflection(wanted: float) -> float:
    """How far a stick has to be pushed, in [-1, 1], for an action with turbo."""
    way = WAYS[min(len(WAYS) - 1, bisect.bisect_left(BENT, abs(wanted)))] if wanted else 0.0
    return way if wanted > 0.0 else -way


class Fingers:
    """Implements `scripted_person.Controls`. `put(held, forward, turn)` sets the dead-man (and turbo) and the sticks,
    `press` and `lift` are for the one button that a session has. A context: its thread moves the fingers.
    """

    def __init__(self, watch, put, button) -> None:
        self._applied, self._session = watch.reader(APPLIED), watch.reader(SESSION)
        self._put, self._button = put, button
        self.action = None
        self._asked = threading.Event()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._move)

    def ask(self, request) -> None:
        """One button asks for the proof, and then ends the session."""
        assert request in (Request.PROVE, Request.FINISH)
        self._asked.set()

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join()

    def _move(self) -> None:
        gripped_s = looked_s = pressed_s = float("-inf")
        while not self._stop.wait(1.0 / RATE_HZ):
            now_s, action, newest = time.monotonic(), self.action, self._applied.newest()
            stopped = newest is not None and newest.message.reason in STOPPED
            told = self._session.newest()
            taught = told is not None and told.message.stage in TAUGHT  # in a proof hands stay off
            if stopped and taught and action is None and now_s > looked_s + LOOK_S:  # as the voice says
                gripped_s = looked_s = now_s
            forward, turn = (0.0, 0.0) if stopped or action is None else map(deflection, action)
            self._put(action is not None or now_s < gripped_s + PRESS_S, forward, turn)
            if self._asked.is_set():
                self._asked.clear()
                pressed_s = now_s
                self._button(True)
            elif pressed_s < now_s - PRESS_S:
                pressed_s = float("inf")
                self._button(False)
        self._put(False, 0.0, 0.0)
