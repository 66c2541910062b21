"""The services of std_srvs that are offered or asked here, as types of ROS 2: `Trigger` and `SetBool`.

A service is hashed as a type of its own, with its request, its response and the event that introspection publishes of
both. On the wire there are but the first two, each as CDR.
"""

from dataclasses import dataclass
from typing import Any

from rosbags.interfaces import Nodetype

from lira.hal.errors import CodecError
from lira.hal.messages.codec import MALFORMED
from lira.hal.messages.ros_types import TYPES

TRIGGER = "std_srvs/srv/Trigger"
SET_BOOL = "std_srvs/srv/SetBool"
_REQUEST, _RESPONSE, _EVENT = "_Request", "_Response", "_Event"
_ANSWER: Any = [("success", (Nodetype.BASE, ("bool", 0))), ("message", (Nodetype.BASE, ("string", 0)))]
_ASKED: dict[str, Any] = {TRIGGER: [], SET_BOOL: [("data", (Nodetype.BASE, ("bool", 0)))]}


def _one(name: str) -> Any:
    return Nodetype.NAME, name


def _register(service: str, asked: Any) -> None:
    """Add a service to the types, as rosidl makes it of a .srv file."""
    request, response, event = (service + end for end in (_REQUEST, _RESPONSE, _EVENT))
    seen: Any = [
        ("info", _one("service_msgs/msg/ServiceEventInfo")),
        ("request", (Nodetype.SEQUENCE, (_one(request), 1))),
        ("response", (Nodetype.SEQUENCE, (_one(response), 1))),
    ]
    parts = [("request_message", request), ("response_message", response), ("event_message", event)]
    whole: Any = [(name, _one(kind)) for name, kind in parts]
    TYPES.register({request: ([], asked), response: ([], _ANSWER), event: ([], seen), service: ([], whole)})


for _service, _fields in _ASKED.items():
    _register(_service, _fields)


@dataclass(frozen=True, slots=True)
class Answer:
    """What a service of std_srvs answers."""

    success: bool
    message: str


def encode_request(service: str, data: bool | None = None) -> bytes:
    """Write a request; `data` is `SetBool`'s."""
    return _encode(service + _REQUEST, [] if data is None else [data])


def decode_request(service: str, payload: bytes) -> bool | None:
    """Read a request: `SetBool`'s data, None for a `Trigger`. Raises `CodecError`.

    An empty request counts whole: not everybody writes the byte by which rosidl fills what has no fields.
    """
    if service == TRIGGER:
        return None
    return bool(_decode(service + _REQUEST, payload).data)


def encode_answer(service: str, answer: Answer) -> bytes:
    """Write an answer."""
    return _encode(service + _RESPONSE, [answer.success, answer.message])


def decode_answer(service: str, payload: bytes) -> Answer:
    """Read an answer. Raises `CodecError`."""
    found = _decode(service + _RESPONSE, payload)
    return Answer(bool(found.success), str(found.message))


def _encode(name: str, values: list[Any]) -> bytes:
    return bytes(TYPES.serialize_cdr(TYPES.types[name](*values), name))


def _decode(name: str, payload: bytes) -> Any:
    try:
        return TYPES.deserialize_cdr(payload, name)
    except MALFORMED as error:
        raise CodecError(f"{len(payload)} bytes are no {name}: {error}") from error
