"""The service of std_srvs that is offered here, as a type of ROS 2: `Trigger`, which asks nothing.

A service is hashed as a type of its own, with its request, its response and the event that introspection publishes of
both. On the wire there are but the first two, each as CDR, and what a request says is only that it was made.
"""

from dataclasses import dataclass
from typing import Any

from rosbags.interfaces import Nodetype

from lira.hal.messages.ros.types import TYPES

TRIGGER = "std_srvs/srv/Trigger"
_REQUEST, _RESPONSE, _EVENT = (f"{TRIGGER}_{part}" for part in ("Request", "Response", "Event"))


def _register() -> None:
    """Add it to the types, as rosidl makes it of its .srv file."""

    def named(name: str) -> Any:
        return Nodetype.NAME, name

    answered: Any = [("success", (Nodetype.BASE, ("bool", 0))), ("message", (Nodetype.BASE, ("string", 0)))]
    seen: Any = [
        ("info", named("service_msgs/msg/ServiceEventInfo")),
        ("request", (Nodetype.SEQUENCE, (named(_REQUEST), 1))),
        ("response", (Nodetype.SEQUENCE, (named(_RESPONSE), 1))),
    ]
    parts = [("request_message", _REQUEST), ("response_message", _RESPONSE), ("event_message", _EVENT)]
    whole: Any = [(name, named(kind)) for name, kind in parts]
    TYPES.register({_REQUEST: ([], []), _RESPONSE: ([], answered), _EVENT: ([], seen), TRIGGER: ([], whole)})


_register()


@dataclass(frozen=True, slots=True)
class Answer:
    """What it answers."""

    success: bool
    message: str


def encode_answer(answer: Answer) -> bytes:
    """Write an answer."""
    return bytes(TYPES.serialize_cdr(TYPES.types[_RESPONSE](answer.success, answer.message), _RESPONSE))
