"""A service (`Trigger`) in a graph of rmw_zenoh: a query, answered with the number and the id that came with it."""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import zenoh
from zenoh.handlers import RingChannel

from lira.hal.bus.boundary import Boundary
from lira.hal.bus.connection import Connection
from lira.hal.bus.reader import take
from lira.hal.bus.topics import QUESTION_BYTES
from lira.hal.rmw.attachment import GID_BYTES, RmwAttachment, parse_rmw_attachment
from lira.hal.rmw.services import Answer, encode_answer

ASKED = 16  # requests that wait at most; the oldest makes room


class RosService:
    """One. Nothing is done with a request before `serve`."""

    def __init__(self, connection: Connection, key: str, answer: Callable[[], Answer], boundary: Boundary) -> None:
        self._connection = connection
        self._key = key
        self._answer = answer
        self._boundary = boundary
        self._queryable = connection.declare(partial(_declare, key))

    def serve(self) -> None:
        """Answer what was asked since the last time."""
        for _ in range(ASKED):
            query: zenoh.Query | None = take(self._connection, self._queryable)
            if query is None:
                return
            with self._boundary.guard(self._key), query:
                self._serve(query)

    def _serve(self, query: zenoh.Query) -> None:
        if str(query.key_expr) != self._key:  # who asks all keys at once means none of them
            self._boundary.refuse(self._key, "not by its name")
            return
        payload, attached = query.payload, query.attachment
        if payload is not None and len(payload) > QUESTION_BYTES:
            self._boundary.refuse(self._key, "too long")
            return
        answer = encode_answer(self._answer())
        request = parse_rmw_attachment(None if attached is None else bytes(attached))
        number, gid = (0, bytes(GID_BYTES)) if request is None else (request.number, request.gid)
        query.reply(self._key, answer, attachment=RmwAttachment(number, time.time_ns(), gid).to_bytes())


def _declare(key: str, session: zenoh.Session) -> Any:
    return session.declare_queryable(key, RingChannel(ASKED), complete=True)
