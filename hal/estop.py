"""The emergency stop over the bus: a query that is acknowledged, beside the latched topic that a ROS peer may use.

Anybody may press. `True` on the topic presses; only the query releases, so that a peer which repeats its idle state
releases nothing. The robot stays at zero until a neutral command comes after the release.
"""

import threading

import msgspec

from hal.bus import Bus, Question
from hal.errors import BusError
from hal.governed import GovernedRobot
from hal.topics import ESTOP_QUERY

PRESS, RELEASE, LOOK = b"press", b"release", b""
LOOK_S = 0.005
ANSWER_S = 2.0


class EstopState(msgspec.Struct, frozen=True):
    """What the robot acknowledges: the governor's state, and how many commands it has refused, by reason."""

    state: str
    refused: dict[str, int]

    @property
    def pressed(self) -> bool:
        """Whether the emergency stop holds the robot."""
        return self.state == "emergency"


class EstopDesk:
    """Answers the query, on a thread of its own: neither a sensor nor a slow answer holds it or the wheels up."""

    def __init__(self, robot: GovernedRobot, bus: Bus) -> None:
        self._robot = robot
        self._asked = bus.questions(ESTOP_QUERY)

    def run(self, stop: threading.Event) -> None:
        """Answer until `stop` is set."""
        while not stop.wait(LOOK_S):
            self.serve()

    def serve(self) -> None:
        """Do and answer what was asked since the last time."""
        self._asked.serve(self._answer)

    def _answer(self, question: Question) -> None:
        if question.payload == PRESS:
            self._robot.press_estop()
        elif question.payload == RELEASE:
            self._robot.release_estop()
        elif question.payload != LOOK:
            question.refuse(f"say {PRESS.decode()} or {RELEASE.decode()}, or nothing to look")
            return
        question.answer(msgspec.json.encode(EstopState(self._robot.state, self._robot.refused)))


def press_estop(bus: Bus, timeout_s: float = ANSWER_S) -> EstopState:
    """Stop the robot and wait for its acknowledgement. Raises `BusError` if none comes: then assume that it moves."""
    return _ask(bus, PRESS, timeout_s)


def release_estop(bus: Bus, timeout_s: float = ANSWER_S) -> EstopState:
    """Let the robot go, which then waits for a neutral command. Raises `BusError`."""
    return _ask(bus, RELEASE, timeout_s)


def look_at_estop(bus: Bus, timeout_s: float = ANSWER_S) -> EstopState:
    """Ask how it stands. Raises `BusError`."""
    return _ask(bus, LOOK, timeout_s)


def _ask(bus: Bus, payload: bytes, timeout_s: float) -> EstopState:
    answer = bus.ask(ESTOP_QUERY, payload, timeout_s)
    try:
        return msgspec.json.decode(answer, type=EstopState)
    except msgspec.MsgspecError as error:
        raise BusError(f"the robot answers '{ESTOP_QUERY}' with what is not understood: {error}") from error
