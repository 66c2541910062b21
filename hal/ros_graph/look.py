"""What there is at an address: the tokens that are declared there, and what comes on which key."""

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass

import zenoh
from zenoh.handlers import FifoChannel, RingChannel

from lira.hal.bus.attachment import parse_attachment
from lira.hal.bus.topics import MESSAGE_BYTES
from lira.hal.errors import CodecError
from lira.hal.rmw.attachment import parse_rmw_attachment
from lira.hal.rmw.names import RmwKey, parse_key
from lira.hal.rmw.tokens import ALL_BRIDGES, ALL_RMW, Endpoint, Node, Route, parse_route, parse_token
from lira.hal.ros_graph.session import open_ros_session

TOKENS_S = 2.0
POLL_S = 0.01
KEPT = 4096
MOST_KEYS = 512  # that are told apart; a crowd of names is nobody's robot
OURS, RMW, OTHER, NOTHING = "ours", "rmw_zenoh", "another", "nothing"


@dataclass(frozen=True, slots=True)
class Heard:
    """What came on one key: how often a second, how large, with what attached, of which type by its encoding or key.

    `sample` is the payload of one.
    """

    key: str
    rate_hz: float
    bytes_each: int
    attached: str
    ros_type: str
    sample: bytes = b""

    @property
    def rmw(self) -> RmwKey | None:
        """The key, if it is one of rmw_zenoh."""
        return parse_key(self.key)


@dataclass(frozen=True, slots=True)
class Sight:
    """All of it."""

    nodes: tuple[Node, ...] = ()
    endpoints: tuple[Endpoint, ...] = ()
    routes: tuple[Route, ...] = ()
    heard: tuple[Heard, ...] = ()


def look(address: str, listen_s: float = 0.0) -> Sight:
    """Ask who is there, and listen to everything for a while. Raises `BusError` if nobody answers at the address."""
    session = open_ros_session(connect=address)
    try:
        heard = _Listener(session) if listen_s > 0.0 else None
        keys = [*_tokens(session, ALL_RMW), *_tokens(session, ALL_BRIDGES)]
        found = [parse_token(key) or parse_route(key) for key in keys]
        return Sight(
            tuple(each for each in found if isinstance(each, Node)),
            tuple(each for each in found if isinstance(each, Endpoint)),
            tuple(each for each in found if isinstance(each, Route)),
            () if heard is None else heard.listen(listen_s),
        )
    finally:
        with contextlib.suppress(zenoh.ZError):
            session.close()  # type: ignore[no-untyped-call]


def _tokens(session: zenoh.Session, pattern: str) -> Iterator[str]:
    replies = session.liveliness().get(pattern, FifoChannel(KEPT), timeout=TOKENS_S)
    for reply in replies:
        if reply.ok is not None:
            yield str(reply.ok.key_expr)


class _Listener:
    """Counts what comes, by key."""

    def __init__(self, session: zenoh.Session) -> None:
        self._ring: RingChannel[zenoh.Sample] = RingChannel(KEPT)
        self._subscriber = session.declare_subscriber("**", self._ring)
        self._counts: dict[str, tuple[int, int]] = {}
        self._first: dict[str, zenoh.Sample] = {}

    def listen(self, listen_s: float) -> tuple[Heard, ...]:
        began_s = time.monotonic()
        while time.monotonic() < began_s + listen_s:
            sample = self._subscriber.try_recv()
            if sample is None:
                time.sleep(POLL_S)
            else:
                self._note(sample)
        return tuple(self._heard(key, listen_s) for key in sorted(self._counts))

    def _note(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        if key not in self._counts and len(self._counts) >= MOST_KEYS:
            return
        count, size = self._counts.get(key, (0, 0))
        self._counts[key] = count + 1, size + len(sample.payload)
        self._first.setdefault(key, sample)

    def _heard(self, key: str, listen_s: float) -> Heard:
        (count, size), sample, rmw = self._counts[key], self._first[key], parse_key(key)
        schema = str(sample.encoding).partition(";")[2]
        payload = bytes(sample.payload) if len(sample.payload) <= MESSAGE_BYTES else b""
        ros_type = schema if rmw is None else rmw.ros_type
        return Heard(key, count / listen_s, size // count, _kind(sample), ros_type, payload)


def _kind(sample: zenoh.Sample) -> str:
    """Whose attachment a sample has."""
    if sample.attachment is None:
        return NOTHING
    data = bytes(sample.attachment)
    with contextlib.suppress(CodecError):
        if parse_attachment(data) is not None:
            return OURS
    return OTHER if parse_rmw_attachment(data) is None else RMW
