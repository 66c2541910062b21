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
from weakref import WeakSet

import zenoh
from zenoh.handlers import RingChannel

from hal.errors import BusError

T = TypeVar("T")
LOOK_S = 0.05
RETRY_S = 0.2
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
    """A session, and what is declared on it.

    With `connect` a thread keeps connected: it opens sessions with that until one is up, and another when a link of it
    is lost. Meanwhile there is an `idle` one, which is connected to nobody: what is put then is lost, like anything
    else on a link that broke, and nobody waits.
    """

    def __init__(self, idle: Callable[[], zenoh.Session], connect: Callable[[], zenoh.Session] | None = None) -> None:
        self._idle = idle
        self.session = idle()
        self._declared: WeakSet[Declared[Any]] = WeakSet()  # what nobody uses any more is not declared again
        self._lock = threading.Lock()  # over the session and what is declared on it
        self._closed, self._up = threading.Event(), threading.Event()
        if connect is not None:
            threading.Thread(target=self._keep, args=(connect,), name="bus-keeper", daemon=True).start()

    @property
    def closed(self) -> bool:
        """Whether it was closed, for good."""
        return self._closed.is_set()

    def wait_up(self, timeout_s: float) -> bool:
        """Wait until it was connected once; returns whether it was."""
        return self._up.wait(timeout_s)

    def declare(self, make: Callable[[zenoh.Session], T]) -> Declared[T]:
        """Declare something, on this session and on all that replace it."""
        with self._lock:
            declared = Declared(make, self.session)
            self._declared.add(declared)
        return declared

    def close(self, timeout_s: float) -> bool:
        """Close for good; False if a dead link kept it from closing in time. May be called twice."""
        with self._lock:
            self._closed.set()
        closer = threading.Thread(target=_let_go, args=(self.session,), daemon=True, name="bus-close")
        closer.start()
        closer.join(timeout_s)
        return not closer.is_alive()

    def _keep(self, connect: Callable[[], zenoh.Session]) -> None:
        while not self._closed.is_set():
            try:
                session = connect()
            except BusError:
                self._closed.wait(RETRY_S)
                continue
            events = session.info.declare_link_events_listener(RingChannel(EVENTS))
            self._replace(session)
            self._up.set()
            while not self._closed.wait(LOOK_S):
                if _lost_a_link(events):
                    with contextlib.suppress(BusError):  # then the lost one stays until the next is up
                        self._replace(self._idle())
                    break

    def _replace(self, session: zenoh.Session) -> None:
        with self._lock:
            before = session if self._closed.is_set() else self.session
            if before is not session:
                self.session = session
                for declared in self._declared:
                    declared.move(session)
        # It may take long while links are dead.
        threading.Thread(target=_let_go, args=(before,), daemon=True, name="bus-let-go").start()


def _lost_a_link(events: Any) -> bool:
    lost = False
    while (event := events.try_recv()) is not None:
        lost |= event.kind == zenoh.SampleKind.DELETE
    return lost


def _let_go(session: zenoh.Session) -> None:
    with contextlib.suppress(zenoh.ZError):  # nothing in it is needed any more
        session.close()  # type: ignore[no-untyped-call]
