"""What puts messages on the bus, each with its attachment."""

from dataclasses import replace
from typing import Any, Generic, Protocol, TypeVar

import zenoh
from zenoh import ext

from lira.hal.bus.connection import Connection
from lira.hal.bus.topics import Qos, Topic
from lira.hal.clock import OWN_TIME, TimeBase
from lira.hal.errors import BusError
from lira.hal.messages.ros.codec import encode

M = TypeVar("M")


def shifted(message: Any, offset_s: float) -> Any:
    """Return a message with its stamp, if it has one, moved by so much."""
    stamp_s = getattr(message, "stamp_s", None) if offset_s else None
    return message if stamp_s is None else replace(message, stamp_s=stamp_s + offset_s)


class Attach(Protocol):
    """What makes the attachment of a message; the arguments are those of `Publisher.put`."""

    def __call__(self, time_s: float, seq: int | None, answers: int, *, released: bool) -> bytes:
        """Return it."""


class Publisher(Generic[M]):
    """Publishes a topic on one key, each message with what `attach` makes, its stamp told by the session's `base`."""

    def __init__(
        self, connection: Connection, key: str, topic: Topic[M], qos: Qos, attach: Attach, base: TimeBase = OWN_TIME
    ) -> None:
        self._connection = connection
        self._key = key
        self._qos = qos
        self._encoding = zenoh.Encoding.APPLICATION_CDR.with_schema(topic.ros_type)
        self._attach = attach
        self._base = base
        self._kept: tuple[bytes, bytes] | None = None
        self._publisher = connection.declare(self._anew)

    @property
    def matching(self) -> bool:
        """Whether anybody listens."""
        return bool(self._publisher.now.matching_status.matching)

    def put(
        self, message: M, time_s: float, *, seq: int | None = None, answers: int = -1, released: bool = False
    ) -> None:
        """Send a message at `time_s` on the robot's clock; `seq` is the bus's count on this key unless given.

        Raises `BusError` when the session is closed, `CodecError` for what ROS cannot hold.
        """
        payload = encode(shifted(message, self._base.offset_s))
        self.put_encoded(payload, time_s, seq=seq, answers=answers, released=released)

    def put_encoded(
        self, payload: bytes, time_s: float, *, seq: int | None = None, answers: int = -1, released: bool = False
    ) -> None:
        """As `put`, for a message that is CDR already."""
        attachment = self._attach(time_s, seq, answers, released=released)
        if self._qos.latched:
            self._kept = payload, attachment
        try:
            self._publisher.now.put(payload, attachment=attachment)
        except zenoh.ZError as error:
            if not self._connection.closed:
                return  # its session is just being replaced: lost, like all that was under way on it
            raise BusError(f"the bus does not take messages: {error}", "It is closed: start again.") from error

    def _anew(self, session: zenoh.Session) -> Any:
        """Declare it on a session, which for a latched topic holds what was put last."""
        publisher = self._declare(session)
        if self._kept is not None:
            payload, attachment = self._kept
            publisher.put(payload, attachment=attachment)
        return publisher

    def _declare(self, session: zenoh.Session) -> Any:
        options: dict[str, Any] = {
            "encoding": self._encoding,
            "congestion_control": zenoh.CongestionControl.BLOCK if self._qos.wait else zenoh.CongestionControl.DROP,
            "priority": self._qos.priority,
            "express": self._qos.express,
            "reliability": self._qos.reliability,
        }
        if not self._qos.latched:
            return session.declare_publisher(self._key, **options)
        cache = ext.CacheConfig(max_samples=1)
        return ext.declare_advanced_publisher(session, self._key, cache=cache, publisher_detection=True, **options)
