"""The emergency stop over the bus: queries that are acknowledged, beside the latched topic that a ROS peer may use.

To press, to release and to look are keys of their own, so that with keys each is a permission of its own: anybody may
press and look. `True` on the topic presses; only the query releases, so that a peer which repeats its idle state
releases nothing. The robot stays at zero until a neutral command comes after the release.
"""

import threading
from collections.abc import Callable

import msgspec

from lira.hal.bus.bus import Bus
from lira.hal.bus.questions import Question
from lira.hal.bus.services import EstopState
from lira.hal.bus.topics import ESTOP_LOOK, ESTOP_PRESS, ESTOP_RELEASE
from lira.hal.safety.governed import GovernedRobot

LOOK_S = 0.005


class EstopService:
    """Answers the query, on a thread of its own: neither a sensor nor a slow answer holds it or the wheels up."""

    def __init__(self, robot: GovernedRobot, bus: Bus) -> None:
        self._robot = robot
        self._pressed = bus.questions(ESTOP_PRESS)
        self._released = bus.questions(ESTOP_RELEASE)
        self._looked = bus.questions(ESTOP_LOOK)

    def run(self, stop: threading.Event) -> None:
        """Answer until `stop` is set."""
        while not stop.wait(LOOK_S):
            self.serve()

    def serve(self) -> None:
        """Do and answer what was asked since the last time. What is pressed together with a release stays pressed."""
        self._released.serve(lambda question: self._do(self._robot.release_estop, question))
        self._pressed.serve(lambda question: self._do(self._robot.press_estop, question))
        self._looked.serve(lambda question: self._do(lambda: None, question))

    def _do(self, act: Callable[[], object], question: Question) -> None:
        act()
        question.answer(msgspec.json.encode(EstopState(self._robot.state, self._robot.refused)))
