"""A session that starts anew when it loses a link, with everything that was declared on it.

zenoh mends a lost link by itself, and knows the other end by the id of its session. But the two ends do not lose a link
at the same moment: a closed port is seen at once, a silent one when its lease is over. Whoever comes back before the
other end has noticed is taken for one more link of the connection that still stands there. That end goes on counting
its messages and says nothing of what it has declared, while this one begins at nought and knows nothing: messages are
dropped as old ones, or as nobody's, and both say that all links are up. That does not heal by itself.

So whoever connects comes back as somebody else: with a new session, and so a new id. What the other end has of the old
one dies with its lease.
"""

import contextlib
import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

import zenoh
from zenoh.handlers import RingChannel

from hal.errors import BusError

T = TypeVar("T")
LOOK_S = 0.05
RETRY_S = 1.0
EVENTS = 64  # more links than ever are lost between two looks


class Declared(Generic[T]):
    """Something declared on the session. `now` is what stands for it on the present one."""

    def __init__(self, make: Callable[[zenoh.Session], T], session: zenoh.Session) -> None:
        self._make = make
        self.now = make(session)

    def move(self, session: zenoh.Session) -> None:
        """Declare it on another session."""
        self.now = self._make(session)


class Connection:
    """A session from `open_session`. With `renewed` it is replaced when it loses a link, by a thread of its own.

    Nobody waits for that: what is put meanwhile is lost, like anything else on a link that broke.
    """

    def __init__(self, open_session: Callable[[], zenoh.Session], *, renewed: bool) -> None:
        self._open = open_session
        self.session = open_session()
        self._declared: list[Declared[Any]] = []
        self._lock = threading.Lock()  # over the session and what is declared on it
        self._closed = threading.Event()
        self._keeper: threading.Thread | None = None
        if renewed:
            self._events = _link_events(self.session)
            self._keeper = threading.Thread(target=self._keep, name="bus-keeper", daemon=True)
            self._keeper.start()

    @property
    def closed(self) -> bool:
        """Whether it was closed, for good."""
        return self._closed.is_set()

    def declare(self, make: Callable[[zenoh.Session], T]) -> Declared[T]:
        """Declare something, on this session and on all that replace it."""
        with self._lock:
            declared = Declared(make, self.session)
            self._declared.append(declared)
        return declared

    def close(self, timeout_s: float) -> bool:
        """Close for good; False if a dead link kept it from closing in time. May be called twice."""
        self._closed.set()
        closer = threading.Thread(target=self._close, daemon=True, name="bus-close")
        closer.start()
        closer.join(timeout_s)
        return not closer.is_alive()

    def _close(self) -> None:
        if self._keeper is not None:
            self._keeper.join()
        self.session.close()  # type: ignore[no-untyped-call]  # zenoh's stub

    def _keep(self) -> None:
        while not self._closed.wait(LOOK_S):
            if _lost_a_link(self._events):
                self._renew()

    def _renew(self) -> None:
        """Replace the session, as soon as there is another to be had."""
        while True:
            try:
                session = self._open()
                break
            except BusError:  # a watching session does not open before somebody is there
                if self._closed.wait(RETRY_S):
                    return
        with self._lock:
            old, self.session = self.session, session
            self._events = _link_events(session)
            for declared in self._declared:
                declared.move(session)
        # It may take long while links are dead.
        threading.Thread(target=_let_go, args=(old,), daemon=True, name="bus-let-go").start()


def _link_events(session: zenoh.Session) -> Any:
    return session.info.declare_link_events_listener(RingChannel(EVENTS))


def _lost_a_link(events: Any) -> bool:
    lost = False
    while (event := events.try_recv()) is not None:
        lost |= event.kind == zenoh.SampleKind.DELETE
    return lost


def _let_go(session: zenoh.Session) -> None:
    with contextlib.suppress(zenoh.ZError):  # nothing in it is needed any more
        session.close()  # type: ignore[no-untyped-call]
