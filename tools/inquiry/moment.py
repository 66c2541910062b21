"""One moment of a robot: all that was known of it then, from a recording or from the bus now."""

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from lira.fusion.log.method_trace import State
from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import (
    APPLIED,
    BATTERY,
    CAMERA,
    DECISION,
    METHOD,
    ODOM,
    OPERATOR_ANSWER,
    SCAN,
    SESSION,
    SIM_STATE,
    Topic,
)
from lira.hal.errors import CodecError, StorageError
from lira.hal.messages import Applied, Call, CallName, Decision, MethodCall, Reason, is_neutral
from lira.tools.inquiry.trace import OUTCOMES, Step, outcome_of, recipe_of, steps_of
from lira.tools.operator.view import View
from lira.tools.recording.layout import Head
from lira.tools.recording.reader import Recorded, Recording
from lira.tools.runs.plan import Recipe

ROUNDING_S = 1e-6
ANSWER_S = 1.0  # so much later what a decision led to has been told
NEAR_S = 0.5
WINDOW_S = 5.0  # before the moment: what is older was not known any more
CALLS = (CallName.BEGIN, CallName.UPDATE, CallName.RESET, CallName.END)


@dataclass(slots=True)
class Moment:
    """What was known at `at_s` (robot's clock): the newest of every key, and the step that was being taken.

    `novice` is how far it was, `recipe` what the method was built from; None where that was not heard.
    `moved` is the newest motion that the wheels got, and `result` what they got on the decision.
    """

    head: Head
    at_s: float
    newest: dict[str, Recorded] = field(default_factory=dict)
    step: Step | None = None
    recipe: Recipe | None = None
    novice: State | None = None
    moved: Recorded | None = None
    result: Recorded | None = None
    live: bool = False
    methods: int = 0  # that had begun by then

    def message(self, topic: Topic[Any]) -> Any:
        """The newest of a topic, None if there was none."""
        found = self.newest.get(topic.key)
        return None if found is None else found.message

    def age_s(self, topic: Topic[Any]) -> float:
        """How long ago that was sent."""
        found = self.newest.get(topic.key)
        return float("inf") if found is None else self.at_s - found.sent_s

    @property
    def time_s(self) -> float:
        """The moment in seconds since the recording began."""
        return self.at_s - self.head.began_s

    @property
    def view(self) -> View:
        """The same for those who say it in words."""
        applied: Applied | None = self.message(APPLIED)
        features = self.head.info.profile.features
        return View(
            self.head.robot,
            scan=self.message(SCAN),
            scan_age_s=self.age_s(SCAN),
            picture=self.message(CAMERA),
            picture_age_s=self.age_s(CAMERA),
            odom=self.message(ODOM),
            truth=self.message(SIM_STATE),
            truth_age_s=self.age_s(SIM_STATE),
            applied=applied,
            link_age_s=self.age_s(APPLIED),
            decision=self.message(DECISION),
            decision_age_s=self.age_s(DECISION),
            session=self.message(SESSION),
            session_age_s=self.age_s(SESSION),
            battery=self.message(BATTERY),
            answer=self.message(OPERATOR_ANSWER),
            answer_age_s=self.age_s(OPERATOR_ANSWER),
            estop=applied is not None and applied.reason is Reason.ESTOP,
            confirmed=True,
            lockstep=self.head.lockstep,
            fov_rad=features.fov_rad,
            max_range_m=features.max_range_m,
        )


def moment_at(recording: Recording, at_s: float) -> Moment:
    """Put a moment of a recording together; `at_s` is on the robot's clock.

    Raises `StorageError` if nothing was recorded then.
    """
    at_s += ROUNDING_S
    moment = gather(recording.head, _around(recording, at_s), at_s)
    if not moment.newest:
        began_s = recording.head.began_s
        ends_s = max((each.sent_s for each in recording.messages(APPLIED)), default=began_s) - began_s
        what = f"nothing was recorded {at_s - began_s:.1f} s after the beginning"
        raise StorageError(what, f"It has {ends_s:.1f} s.")
    _learn_of(moment, _calls(recording.messages(METHOD)))
    return moment


def _around(recording: Recording, at_s: float) -> Iterator[Recorded]:
    """Yield what was recorded around a time on the robot's clock.

    A twin's may run faster than the clock by which was recorded: then all is gone through.
    """
    bounds = {"since_s": at_s - WINDOW_S, "until_s": at_s + ANSWER_S}
    near = any(abs(each.sent_s - at_s) < NEAR_S for each in recording.messages(APPLIED, **bounds))
    return recording.messages(**bounds) if near else recording.messages()


def moment_now(bus: Bus, head: Head, heard_s: float) -> Moment:
    """Listen for a while to a watching bus; what is put together is the moment at its end."""
    tap = bus.tap()
    found: list[Recorded] = []
    until_s = time.monotonic() + heard_s
    while time.monotonic() < until_s:
        now_ns = time.time_ns()
        for raw in tap.poll():
            found.append(Recorded(raw.key, raw.ros_type, raw.payload, raw.attachment, now_ns, now_ns, head))
        time.sleep(0.01)
    # Time in lockstep is not that of any clock here: it is now what it was when the robot spoke last.
    spoken_s = [each.sent_s for each in found if each.attachment is not None][-1:]
    now_s = spoken_s[0] if head.lockstep and spoken_s else head.to_robot_s(time.time_ns())
    moment = gather(head, found, now_s)
    moment.live = True
    _learn_of(moment, _calls(each for each in found if each.key == METHOD.key))
    return moment


def gather(head: Head, messages: Iterable[Recorded], at_s: float) -> Moment:
    """Take the newest of everything that was known at a time, a decision from when it was made on.

    What does not decode is left out. `messages` may go on after it, so that it is seen what came of the decision.
    """
    moment = Moment(head, at_s)
    applied: list[Recorded] = []
    for each in messages:
        if not at_s - WINDOW_S <= each.sent_s <= at_s + ANSWER_S:
            continue
        try:
            message = each.message
        except CodecError:
            continue
        known_s = message.stamp_s if isinstance(message, Decision) else each.sent_s
        if known_s > at_s:
            applied += [each] if isinstance(message, Applied) else []
            continue
        moment.newest[each.key] = each
        if isinstance(message, Applied):
            applied.append(each)
            moment.moved = moment.moved if is_neutral(message.twist) else each
    decision: Decision | None = moment.message(DECISION)
    if decision is not None:
        moment.result = next((each for each in applied if each.message.answers == decision.observation), None)
    return moment


def _calls(messages: Iterable[Recorded]) -> Iterator[MethodCall]:
    for each in messages:
        yield from each.message.calls


def _learn_of(moment: Moment, calls: Iterable[MethodCall]) -> None:
    """Find out which method it is and how far, and its newest step."""
    of_this: list[MethodCall] = []
    for call in calls:
        if call.time_s > moment.at_s:
            break
        if call.name is CallName.BEGIN:
            of_this, moment.recipe = [], recipe_of(call)
            moment.methods += 1
        of_this.append(call)
        if call.target == 0 and call.outcome and call.name in CALLS:
            moment.novice = outcome_of(call, OUTCOMES[call.name])
    steps = [step for step in steps_of(of_this) if step.decided is not None and step.time_s <= moment.at_s]
    if steps and moment.at_s - steps[-1].time_s < WINDOW_S:
        moment.step = steps[-1]


def last_call(recording: Recording) -> float:
    """When somebody was called last, on the robot's clock. Raises `StorageError` if nobody was."""
    found_s, call = None, Call.NONE
    for each in recording.messages(DECISION):
        decision: Decision = each.message
        if decision.call not in (Call.NONE, call):
            found_s = decision.stamp_s
        call = decision.call
    if found_s is None:
        raise StorageError("nobody was called", "Look at a time with --at.")
    return found_s


def last_stop(recording: Recording) -> float:
    """When the wheels stopped last, on the robot's clock. Raises `StorageError` if they never did."""
    found_s, moved = None, False
    for each in recording.messages(APPLIED):
        moves = not is_neutral(each.message.twist)
        if moved and not moves:
            found_s = each.sent_s
        moved = moves
    if found_s is None:
        raise StorageError("the robot never stopped", "Look at a time with --at.")
    return found_s
