"""What people and processes tell each other: buttons, sticks, the clock, diagnostics."""

from typing import Any

import numpy as np

from lira.hal.messages import (
    Bool,
    Clock,
    DiagnosticArray,
    DiagnosticStatus,
    Joy,
    JoyFeedback,
    OperatorAnswer,
    OperatorRequest,
    Request,
)
from lira.hal.messages.ros.types import Codec, header, ros, seconds, stamp, time_to


def _clock_to(m: Clock) -> Any:
    return ros("rosgraph_msgs/msg/Clock")(time_to(m.stamp_s))


def _clock_from(message: Any) -> Clock:
    return Clock(seconds(message.clock))


def _diagnostics_to(m: DiagnosticArray) -> Any:
    status, pair = ros("diagnostic_msgs/msg/DiagnosticStatus"), ros("diagnostic_msgs/msg/KeyValue")
    return ros("diagnostic_msgs/msg/DiagnosticArray")(
        header(m.stamp_s, ""),
        [status(s.level, s.name, s.message, "", [pair(key, value) for key, value in s.values]) for s in m.status],
    )


def _diagnostics_from(message: Any) -> DiagnosticArray:
    return DiagnosticArray(
        stamp(message),
        tuple(
            DiagnosticStatus(s.level, s.name, s.message, tuple((v.key, v.value) for v in s.values))
            for s in message.status
        ),
    )


def _bool_to(m: Bool) -> Any:
    return ros("std_msgs/msg/Bool")(m.data)


def _bool_from(message: Any) -> Bool:
    return Bool(bool(message.data))


def _joy_to(m: Joy) -> Any:
    return ros("sensor_msgs/msg/Joy")(
        header(m.stamp_s, "joy"), np.array(m.axes, np.float32), np.array(m.buttons, np.int32)
    )


def _joy_from(message: Any) -> Joy:
    return Joy(stamp(message), tuple(map(float, message.axes)), tuple(map(int, message.buttons)))


def _feedback_to(m: JoyFeedback) -> Any:
    return ros("sensor_msgs/msg/JoyFeedback")(m.type, m.id, m.intensity)


def _feedback_from(message: Any) -> JoyFeedback:
    return JoyFeedback(message.type, message.id, message.intensity)


def _request_to(m: OperatorRequest) -> Any:
    return ros("lira_msgs/msg/OperatorRequest")(m.request.value, m.name)


def _request_from(message: Any) -> OperatorRequest:
    return OperatorRequest(Request(message.request), message.name)


def _answer_to(m: OperatorAnswer) -> Any:
    head = header(m.stamp_s, "")
    return ros("lira_msgs/msg/OperatorAnswer")(head, m.paused, m.count, m.accepted, m.words)


def _answer_from(message: Any) -> OperatorAnswer:
    return OperatorAnswer(stamp(message), bool(message.paused), message.count, bool(message.accepted), message.words)


CODECS: dict[type, Codec] = {
    Clock: Codec("rosgraph_msgs/msg/Clock", _clock_to, _clock_from),
    DiagnosticArray: Codec("diagnostic_msgs/msg/DiagnosticArray", _diagnostics_to, _diagnostics_from),
    Bool: Codec("std_msgs/msg/Bool", _bool_to, _bool_from),
    Joy: Codec("sensor_msgs/msg/Joy", _joy_to, _joy_from),
    JoyFeedback: Codec("sensor_msgs/msg/JoyFeedback", _feedback_to, _feedback_from),
    OperatorRequest: Codec("lira_msgs/msg/OperatorRequest", _request_to, _request_from),
    OperatorAnswer: Codec("lira_msgs/msg/OperatorAnswer", _answer_to, _answer_from),
}
