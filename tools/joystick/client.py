"""The bus side of the bridge: sends what the hand orders, listens to who drives and who calls.

Commands go straight to the robot's governor, stamped on the robot's clock, and never wait for an answer.
"""

import math
import threading
from collections.abc import Callable

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import LOCKSTEP, ask_info, press_estop, release_estop
from lira.hal.bus.topics import (
    APPLIED,
    DECISION,
    ESTOP,
    JOY,
    JOY_FEEDBACK,
    OPERATOR,
    OPERATOR_ANSWER,
    SESSION,
    TELEOP,
)
from lira.hal.clock import ClockEstimate
from lira.hal.errors import BusError
from lira.hal.messages import (
    Action,
    Applied,
    Bool,
    Decision,
    Joy,
    JoyFeedback,
    OperatorAnswer,
    OperatorRequest,
    Request,
    SessionState,
    Twist,
)
from lira.hal.profile import RobotProfile

DEPTH = 16
ANSWER_S = 2.0  # after that nobody will answer a request


class TeleopClient:
    """One robot's controls: commands go over `bus`; `watch`, a watching bus, hears who calls.

    Raises `BusError` if no robot answers, or one in lockstep: nobody's hand is that fast.
    """

    def __init__(self, bus: Bus, watch: Bus, answer_s: float, say: Callable[[str], None] = print) -> None:
        info = ask_info(bus, answer_s)
        if info.mode == LOCKSTEP:
            raise BusError("the robot runs in lockstep, which no hand can follow", "Start it without --lockstep.")
        self.profile: RobotProfile = info.profile
        self._bus = bus
        self._say = say
        self._teleop = bus.publisher(TELEOP)
        self._joy = bus.publisher(JOY)
        self._estop = bus.publisher(ESTOP)
        self._results = bus.reader(APPLIED, DEPTH)
        self._feedback = watch.reader(JOY_FEEDBACK, DEPTH)
        self._decisions = watch.reader(DECISION)
        self._requests = bus.publisher(OPERATOR)
        self._answers = watch.reader(OPERATOR_ANSWER, DEPTH)
        self._sessions = watch.reader(SESSION)
        self._answered = 0
        self._asked: tuple[Request, float] | None = None  # and when, until it is answered
        self.confirmed = False  # that the emergency stop holds which was pressed here: by the robot itself
        self.answer: OperatorAnswer | None = None
        self.answered_s = -math.inf  # when it came
        self.experts: tuple[str, ...] = ()
        self._clock = ClockEstimate()

    @property
    def known(self) -> bool:
        """Whether the robot has been heard, so that commands can be stamped on its clock."""
        return self._clock.known

    @property
    def robot(self) -> str:
        """The robot's name."""
        return self._bus.robot

    @property
    def session(self) -> SessionState | None:
        """How a session of teaching goes, as it was heard last."""
        newest = self._sessions.newest()
        return None if newest is None else newest.message

    @property
    def session_s(self) -> float:
        """When that was heard."""
        newest = self._sessions.newest()
        return -math.inf if newest is None else newest.arrived_s

    @property
    def paused(self) -> bool:
        """Whether driving and learning wait for a person."""
        return self.answer is not None and self.answer.paused

    def listen(self) -> Applied | None:
        """Follow the robot's clock. Returns the newest of what was applied since the last time."""
        newest = None
        for received in self._results.poll():
            sent = received.attachment
            if sent is not None and self._clock.hear(sent.epoch, sent.time_s, received.arrived_s):
                newest = received.message
        return newest

    def drive(self, action: Action, released: bool, local_s: float) -> None:
        """Send one command; nothing before the robot was heard."""
        if self._clock.known:
            base = self.profile.base
            twist = Twist(action[0] * base.max_linear_m_s, action[1] * base.max_angular_rad_s)
            self._teleop.put(twist, self._clock.now(local_s), released=released)

    def show(self, axes: tuple[float, ...], buttons: tuple[int, ...], local_s: float) -> None:
        """Publish the pad on `joy`."""
        if self._clock.known:
            now_s = self._clock.now(local_s)
            self._joy.put(Joy(now_s, axes, buttons), now_s)

    def feedback(self) -> list[JoyFeedback]:
        """What the pad was asked to do since the last time."""
        return [received.message for received in self._feedback.poll()]

    def decisions(self) -> list[Decision]:
        """What the learner has decided since the last time, as far as it was heard."""
        decisions = [received.message for received in self._decisions.poll()]
        if decisions:
            self.experts = tuple(expert.name for expert in decisions[-1].experts)
        return decisions

    def ask(self, request: OperatorRequest, local_s: float) -> None:
        """Ask something of whoever drives and learns. Before the robot was heard nobody gets it, nor answers."""
        self._asked = request.request, local_s
        if self._clock.known:
            self._requests.put(request, self._clock.now(local_s))

    def answers(self) -> list[OperatorAnswer]:
        """What was answered since the last time, to whomever."""
        new = []
        for received in self._answers.poll():
            answer = received.message
            self.answer, self.answered_s = answer, received.arrived_s
            if answer.count not in (0, self._answered):
                new.append(answer)
                self._asked = None
            self._answered = answer.count
        return new

    def unanswered(self, local_s: float) -> Request | None:
        """What was asked so long ago that nobody will answer. Tells it once."""
        if self._asked is None or local_s - self._asked[1] < ANSWER_S:
            return None
        request, self._asked = self._asked[0], None
        return request

    def estop(self, pressed: bool) -> None:
        """Press or release the emergency stop: at once on the topic, and by a query that waits aside for its answer.

        Only the robot that is heard can answer: what comes from another session confirms nothing.
        """
        self.confirmed = False
        self._estop.put(Bool(pressed), 0.0)
        threading.Thread(target=self._ask, args=(pressed,), name="estop", daemon=True).start()

    def _ask(self, pressed: bool) -> None:
        ask = press_estop if pressed else release_estop
        try:
            state = ask(self._bus, epoch=self._clock.epoch)
        except BusError as error:
            self._say(f"EMERGENCY STOP NOT ACKNOWLEDGED: {error}" if pressed else f"not released: {error}")
        else:
            self.confirmed = state.pressed
            words = "emergency stop: the robot stands" if state.pressed else "emergency stop released"
            self._say(f"{words} (confirmed by the robot)")
