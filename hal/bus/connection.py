"""A session that starts anew when it loses a link, with everything that was declared on it.

zenoh mends a lost link by itself, and knows the other end by the id of its session. But the two ends do not lose a link
at the same moment: a closed port is seen at once, a silent one when its lease is over. Whoever comes back before the
other end has noticed is taken for one more link of the connection that still stands there. That end goes on counting
its messages and says nothing of what it has declared, while this one begins at nought and knows nothing: messages are
dropped as old ones, or as nobody's, and both say that all links are up. That does not heal by itself.

So whoever connects comes back as somebody else: with a new session, and so a new id. What the other end has of the old
one dies with its lease.

Whoever listens begins a new session, too, when its keys change: zenoh reads who may do what once, and nothing but the
end of the old session ends the links of those who may not have them any more.
"""

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Any, Generic, TypeVar
from weakref import WeakSet

import zenoh
from zenoh.handlers import RingChannel

from lira.hal.errors import BusError, LiraError

T = TypeVar("T")
LOOK_S = 0.05
RETRY_S = 0.2
STALE_S = 0.5
CLOSING_S = 2.0
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
    is lost. With `listen` the first session comes from that, and its failure is raised here; a thread opens another
    whenever `stale` says so. Meanwhile there is an `idle` one, which is connected to nobody: what is put then is lost,
    like anything else on a link that broke, and nobody waits. `trouble` says why the next is not up yet, "" otherwise.
    """

    def __init__(
        self,
        idle: Callable[[], zenoh.Session],
        connect: Callable[[], zenoh.Session] | None = None,
        listen: Callable[[], zenoh.Session] | None = None,
        stale: Callable[[], bool] | None = None,
    ) -> None:
        self._idle = idle
        self.trouble = ""
        self.session = idle() if listen is None else listen()
        self._declared: WeakSet[Declared[Any]] = WeakSet()  # what nobody uses any more is not declared again
        self._lock = threading.Lock()  # over the session and what is declared on it
        self._closed, self._up = threading.Event(), threading.Event()
        self._threads: list[threading.Thread] = []  # that may be inside zenoh
        self._leaving: threading.Thread | None = None  # closes the session before this one
        if connect is not None:
            self._begin(self._keep, connect)
        if listen is not None and stale is not None:
            self._begin(self._keep_listening, listen, stale)

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

    def check_open(self, error: zenoh.ZError) -> None:
        """Raise `BusError` if that went wrong because it is closed for good."""
        if self.closed:
            raise BusError(f"the bus is closed: {error}", "Open it again.") from error

    def close(self, timeout_s: float) -> bool:
        """Close for good; False if a dead link kept it from closing in time. May be called twice.

        It waits for its threads: Python aborts the process when one comes out of zenoh while the interpreter ends.
        """
        with self._lock:
            self._closed.set()
            self._begin(_let_go, self.session)
        until_s = time.monotonic() + timeout_s
        for thread in list(self._threads):
            thread.join(max(0.0, until_s - time.monotonic()))
        return not any(thread.is_alive() for thread in self._threads)

    def _begin(self, work: Callable[..., None], *arguments: Any) -> threading.Thread:
        self._threads = [thread for thread in self._threads if thread.is_alive()]
        thread = threading.Thread(target=work, args=arguments, name=f"bus{work.__name__}", daemon=True)
        thread.start()
        self._threads.append(thread)
        return thread

    def _keep(self, connect: Callable[[], zenoh.Session]) -> None:
        while not self._closed.is_set():
            try:
                session = connect()
            except BusError:
                self._closed.wait(RETRY_S)
                continue
            events = session.info.declare_link_events_listener(RingChannel(EVENTS))
            if not self._replace(session):
                self._replace(self._idle())
                self._closed.wait(RETRY_S)
                continue
            self._up.set()
            while not self._closed.wait(LOOK_S):
                if _lost_a_link(events) and not self.closed:
                    with contextlib.suppress(BusError):  # then the lost one stays until the next is up
                        self._replace(self._idle())
                    break

    def _keep_listening(self, listen: Callable[[], zenoh.Session], stale: Callable[[], bool]) -> None:
        while not self._closed.wait(STALE_S):
            if not self.trouble and not stale():
                continue
            self._let_all_go()
            try:
                session = listen()
            except LiraError as error:
                self.trouble = str(error)
            else:
                self.trouble = "" if self._replace(session) else "the session ended as it began"

    def _let_all_go(self) -> None:
        """End all links, so that the address is free. Whatever it takes: some of them may be there no longer."""
        before = self.session
        try:
            idle = self._idle()
        except BusError:  # a crowd holds all descriptors
            _let_go(before)
        else:
            self._replace(idle)
            if self._leaving is not None:
                self._leaving.join(CLOSING_S)

    def _replace(self, session: zenoh.Session) -> bool:
        """Go on with another session; returns whether all that was declared is declared on it.

        To declare can take as long as a link that hangs, so nobody who declares or closes has to wait for it.
        """
        with self._lock:
            closed = self._closed.is_set()
            before, self.session = self.session, self.session if closed else session
            declared = list(self._declared)
        if closed:
            _let_go(session)
            return False
        try:
            for each in declared:
                each.move(session)
        except zenoh.ZError:
            return False  # it died already, or was closed meanwhile
        finally:
            self._leave(before)
        return True

    def _leave(self, session: zenoh.Session) -> None:
        """Close a session, which may take long while links are dead: beside, unless `close` waits for it here."""
        with self._lock:
            if beside := not self._closed.is_set():
                self._leaving = self._begin(_let_go, session)
        if not beside:
            _let_go(session)


def _lost_a_link(events: Any) -> bool:
    lost = False
    try:
        while (event := events.try_recv()) is not None:
            lost |= event.kind == zenoh.SampleKind.DELETE
    except zenoh.ZError:  # the session was closed, and all its links with it
        return True
    return lost


def _let_go(session: zenoh.Session) -> None:
    with contextlib.suppress(zenoh.ZError):  # nothing in it is needed any more
        session.close()  # type: ignore[no-untyped-call]
