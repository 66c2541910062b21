"""Keeps a device running in a thread of its own: what is lost is opened again, and says so meanwhile."""

import sys
import threading
import time
from collections.abc import Callable

from lira.hal.errors import ConfigError, DeviceError, LiraError, MissingExtraError

RETRY_S = 1.0
SLOWEST_S = 5.0  # each further try waits twice as long, up to this
WORKED_S = 10.0  # a session that worked for so long has earned a quick next one
JOIN_S = 3.0
LOOK_S = 0.02
UNMENDABLE = (ConfigError, MissingExtraError)  # to try again makes no difference

Session = Callable[[threading.Event, Callable[[], None]], None]
"""Opens a device, calls the second argument once it works, runs until the event is set, and closes it.

Raises `DeviceError` when it is missing, wrong or lost.
"""


class Supervisor:
    """Runs sessions of one device, one after the other, until closed. Whatever ends a session, there is a next one.

    `rest` is called at the end, when the device may have been left as a lost session had it.
    """

    def __init__(self, name: str, session: Session, rest: Callable[[], None] = lambda: None) -> None:
        self.name = name
        self._session = session
        self._rest = rest
        self._stop = threading.Event()
        self._alive = threading.Event()
        self._began_s = 0.0
        self._thread: threading.Thread | None = None
        self._failure: LiraError | None = None
        self.sessions = 0
        self.losses = 0  # how often it worked and then did not; only grows

    @property
    def alive(self) -> bool:
        """Whether the device works now."""
        return self._alive.is_set()

    @property
    def failure(self) -> LiraError | None:
        """Why the device does not work now; None while it does, or was never tried."""
        return None if self.alive else self._failure

    def start(self) -> None:
        """Begin to open the device, without waiting for it."""
        self._stop.clear()
        self._failure = None
        self._thread = threading.Thread(target=self._run, name=f"robot-{self.name}", daemon=True)
        self._thread.start()

    def wait_alive(self, timeout_s: float) -> None:
        """Wait until the device works: it may still boot, so it is tried again and again.

        Raises what the last try failed with after the time, at once if no further one would help.
        """
        until_s, told = time.monotonic() + timeout_s, ""
        while not self._alive.wait(LOOK_S):
            failure = self._failure
            if failure is not None and failure.what != told:
                told = failure.what
                print(f"{self.name}: {told}; trying on for {timeout_s:.0f} s", file=sys.stderr, flush=True)
            if isinstance(failure, UNMENDABLE) or (failure is not None and time.monotonic() > until_s):
                raise failure
            if time.monotonic() > until_s:
                raise DeviceError(f"the {self.name} does not answer", "Check plug and power.")

    def close(self) -> None:
        """End the session, which lets go of the device, and the thread. May be called twice."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(JOIN_S)
            self._thread = None

    def _run(self) -> None:
        wait_s = RETRY_S
        while not self._stop.is_set():
            try:
                self._session(self._stop, self._begin)
            except LiraError as error:
                self._failure = error
            except Exception as error:  # noqa: BLE001 - a fault of ours; told like any other, and the device lives on
                self._failure = unexpected(self.name, error)
            if self._alive.is_set():
                self.losses += 1
                self._alive.clear()
                if time.monotonic() - self._began_s >= WORKED_S:
                    wait_s = RETRY_S
            self._stop.wait(wait_s)
            wait_s = max(RETRY_S, min(2.0 * wait_s, SLOWEST_S))
        self._rest()

    def _begin(self) -> None:
        self.sessions += 1
        self._began_s = time.monotonic()
        self._alive.set()


def unexpected(name: str, error: Exception) -> DeviceError:
    """What to say, in one line, of an error that no driver should let through."""
    words = " ".join(str(error).split())[:200]
    return DeviceError(
        f"the driver of the {name} failed: {type(error).__name__}{': ' if words else ''}{words}",
        "It is opened again; if that does not help, unplug the device and plug it in again, and report this line.",
    )
