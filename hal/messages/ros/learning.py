"""Our own messages about learning: decisions, and a twin's ground truth."""

import math
from typing import Any

import numpy as np

from lira.hal.messages import (
    Action,
    Call,
    CallName,
    CourseState,
    Decision,
    ExpertView,
    FeatureArray,
    LabelCounts,
    MethodCall,
    MethodCalls,
    Phase,
    SessionState,
    Stage,
)
from lira.hal.messages.ros.types import Codec, header, ros, stamp

_COURSE_FIELDS = tuple(CourseState.__dataclass_fields__)[1:]
_COUNT_FIELDS = tuple(LabelCounts.__dataclass_fields__)
_SESSION_FIELDS = tuple(SessionState.__dataclass_fields__)[2:]


def _course_to(m: CourseState) -> Any:
    values = [getattr(m, name) for name in _COURSE_FIELDS]
    return ros("lira_msgs/msg/CourseState")(header(m.stamp_s, "odom"), *values)


def _course_from(message: Any) -> CourseState:
    return CourseState(stamp(message), *(getattr(message, name) for name in _COURSE_FIELDS))


def _action_from(values: Any) -> Action:
    return float(values[0]), float(values[1])


def _decision_to(m: Decision) -> Any:
    expert = ros("lira_msgs/msg/ExpertView")
    return ros("lira_msgs/msg/Decision")(
        header=header(m.stamp_s, "base_link"),
        observation=m.observation,
        driver=str(m.driver),
        call=str(m.call),
        executed=np.array(m.executed, np.float64),
        novice=np.array(m.novice, np.float64),
        has_human=m.human is not None,
        human=np.array(m.human or (math.nan, math.nan), np.float64),
        experts=[expert(e.name, np.array(e.action, np.float64), e.activation, e.active) for e in m.experts],
        threshold=m.threshold,
        labels=ros("lira_msgs/msg/LabelCounts")(*(getattr(m.labels, name) for name in _COUNT_FIELDS)),
        training_steps=m.training_steps,
        interventions=m.interventions,
        calls=m.calls,
        phase=str(m.phase),
        lap=m.lap,
    )


def _decision_from(message: Any) -> Decision:
    return Decision(
        stamp_s=stamp(message),
        observation=message.observation,
        driver=message.driver,
        call=Call(message.call),
        executed=_action_from(message.executed),
        novice=_action_from(message.novice),
        human=_action_from(message.human) if message.has_human else None,
        experts=tuple(ExpertView(e.name, _action_from(e.action), e.activation, e.active) for e in message.experts),
        threshold=message.threshold,
        labels=LabelCounts(*(getattr(message.labels, name) for name in _COUNT_FIELDS)),
        training_steps=message.training_steps,
        interventions=message.interventions,
        calls=message.calls,
        phase=Phase(message.phase),
        lap=message.lap,
    )


def _session_to(m: SessionState) -> Any:
    values = {name: getattr(m, name) for name in _SESSION_FIELDS}
    values["curve"] = np.array(m.curve, np.float64)
    return ros("lira_msgs/msg/SessionState")(header=header(m.stamp_s, ""), stage=str(m.stage), **values)


def _session_from(message: Any) -> SessionState:
    values = {name: getattr(message, name) for name in _SESSION_FIELDS}
    values["curve"] = tuple(map(float, message.curve))
    return SessionState(stamp(message), Stage(message.stage), **values)


def _calls_to(m: MethodCalls) -> Any:
    call, array = ros("lira_msgs/msg/MethodCall"), ros("lira_msgs/msg/FeatureArray")
    return ros("lira_msgs/msg/MethodCalls")(
        header(m.stamp_s, ""),
        [
            call(
                name=str(each.name),
                target=each.target,
                time_s=each.time_s,
                argument=each.argument,
                has_action=each.action is not None,
                action=np.array(each.action or (math.nan, math.nan), np.float64),
                features=[array(seen.name, np.frombuffer(seen.data, np.uint8)) for seen in each.features],
                outcome=each.outcome,
            )
            for each in m.calls
        ],
    )


def _calls_from(message: Any) -> MethodCalls:
    return MethodCalls(
        stamp(message),
        tuple(
            MethodCall(
                CallName(each.name),
                each.target,
                each.time_s,
                each.argument,
                _action_from(each.action) if each.has_action else None,
                tuple(FeatureArray(seen.name, bytes(seen.data)) for seen in each.features),
                each.outcome,
            )
            for each in message.calls
        ),
    )


CODECS: dict[type, Codec] = {
    CourseState: Codec("lira_msgs/msg/CourseState", _course_to, _course_from),
    MethodCalls: Codec("lira_msgs/msg/MethodCalls", _calls_to, _calls_from),
    Decision: Codec("lira_msgs/msg/Decision", _decision_to, _decision_from),
    SessionState: Codec("lira_msgs/msg/SessionState", _session_to, _session_from),
}
