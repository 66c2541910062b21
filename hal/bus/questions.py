"""Queries and their answers. Each query carries a number that nobody can know before, and so does its answer.

A ROS peer asks in its own way: a query without our attachment whose payload is CDR is a request of std_srvs/Trigger, as
zenoh-bridge-ros2dds passes it on, and is answered as one.
"""

import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import zenoh
from zenoh.handlers import FifoChannel, RingChannel

from lira.hal.bus.attachment import Attachment, parse_attachment
from lira.hal.bus.boundary import Boundary
from lira.hal.bus.connection import Connection
from lira.hal.bus.reader import take
from lira.hal.bus.topics import QUESTION_BYTES
from lira.hal.errors import CodecError
from lira.hal.rmw.services import Answer as TriggerAnswer
from lira.hal.rmw.services import encode_answer

QUESTIONS = 256  # that wait at most; each round answers no more
SHOWN_REASON = 300  # characters of why a question was refused
NONCE_BITS = 62
POLL_S = 0.0005
CDR_STARTS = (b"\x00\x00\x00\x00", b"\x00\x01\x00\x00")


@dataclass(frozen=True, slots=True)
class Answer:
    """What was answered to a query, and the session (`epoch`) of who answered."""

    payload: bytes
    epoch: int


class Question:
    """A query that waits for its answer, which names the session (`epoch`) that gives it, and what it answers.

    `payload` is JSON, what a ROS peer asks with an empty object: a `Trigger` says nothing more.
    """

    def __init__(self, query: zenoh.Query, epoch: int) -> None:
        self._query = query
        self._epoch = epoch
        self._asked = _attachment(query)
        payload = b"" if query.payload is None else bytes(query.payload)
        self._by_ros = self._asked is None and payload.startswith(CDR_STARTS)
        self.payload = b"{}" if self._by_ros else payload
        self.answered = False

    def answer(self, payload: bytes) -> None:
        """Reply with JSON, and be done with it."""
        if self._by_ros:
            self._trigger(TriggerAnswer(True, payload.decode()))
            return
        self.answered = True
        nonce = 0 if self._asked is None else self._asked.seq
        with self._query as query:
            query.reply(query.key_expr, payload, attachment=Attachment(self._epoch, nonce, 0).to_bytes())

    def refuse(self, why: str) -> None:
        """Reply that it cannot be done, and why."""
        why = why[:SHOWN_REASON]
        if self._by_ros:  # an error would leave its client waiting
            self._trigger(TriggerAnswer(False, why))
            return
        self.answered = True
        with self._query as query:
            query.reply_err(why.encode())

    def _trigger(self, answer: TriggerAnswer) -> None:
        self.answered = True
        with self._query as query:
            query.reply(query.key_expr, encode_answer(answer))


class Questions:
    """The queries on a key. Of those that nobody has looked at the newest `QUESTIONS` stay, and nobody waits.

    `told` is the key as the `boundary` counts it. Who asks several keys at once does not get here: the access list lets
    through what names this one.
    """

    def __init__(self, connection: Connection, key: str, told: str, boundary: Boundary, epoch: int) -> None:
        self._connection = connection
        self._told = told
        self._boundary = boundary
        self._epoch = epoch
        # A full ring lets go of the oldest, whose sender asks again. A full FIFO would stop zenoh's own threads.
        self._queryable = connection.declare(lambda session: session.declare_queryable(key, RingChannel(QUESTIONS)))

    def serve(
        self, answer: Callable[[Question], None], most: int = QUESTIONS, prepare: Callable[[], None] = lambda: None
    ) -> None:
        """Have `answer` answer or refuse what was asked since the last time, `most` at most; `prepare` comes before.

        Whatever goes wrong with one is that one's refusal. What `prepare` raises is passed on.
        """
        asked = self._take(most)
        if asked:
            prepare()
        for question in asked:
            with self._boundary.guard(self._told):
                try:
                    answer(question)
                finally:
                    if not question.answered:
                        question.refuse("it could not be done")

    def _take(self, most: int) -> list[Question]:
        asked: list[Question] = []
        for _ in range(most):
            query: zenoh.Query | None = take(self._connection, self._queryable)
            if query is None:
                break
            if query.payload is not None and len(query.payload) > QUESTION_BYTES:
                self._boundary.refuse(self._told, "too long")
            else:
                asked.append(Question(query, self._epoch))
        return asked


def ask_once(connection: Connection, key: str, payload: bytes, timeout_s: float) -> Answer | str | None:
    """Ask a whole key once: the first answer to this very query, or why it is refused; None if nobody is there.

    Raises `BusError` once the bus is closed.
    """
    nonce = secrets.randbits(NONCE_BITS)
    options: dict[str, Any] = {"payload": payload, "attachment": Attachment(0, nonce, 0).to_bytes()}
    try:
        handler = connection.session.get(key, FifoChannel(4), timeout=timeout_s, **options)
    except zenoh.ZError as error:
        connection.check_open(error)
        return None  # its session is just being replaced
    while True:
        try:
            reply = handler.try_recv()
        except zenoh.ZError:  # the channel is empty and closed: all replies are in
            return None
        if reply is None:
            time.sleep(POLL_S)
        elif reply.err is not None:
            return bytes(reply.err.payload).decode(errors="replace")
        elif reply.ok is not None and (sent := _attachment(reply.ok)) is not None and sent.seq == nonce:
            return Answer(bytes(reply.ok.payload), sent.epoch)


def _attachment(carrier: zenoh.Query | zenoh.Sample) -> Attachment | None:
    try:
        return parse_attachment(None if carrier.attachment is None else bytes(carrier.attachment))
    except CodecError:
        return None
