"""Keeps a device running in a thread of its own: what is lost is opened again, and says so meanwhile."""

import threading
from collections.abc import Callable

from hal.errors import DeviceError, LiraError

RETRY_S = 1.0
JOIN_S = 3.0
LOOK_S = 0.02

Session = Callable[[threading.Event, Callable[[], None]], None]
"""Opens a device, calls the second argument once it works, runs until the event is set, and closes it.

Raises `DeviceError` when it is missing, wrong or lost.
"""


class Keeper:
    """Runs sessions of one device, one after the other, until closed."""

    def __init__(self, name: str, session: Session) -> None:
        self.name = name
        self._session = session
        self._stop = threading.Event()
        self._alive = threading.Event()
        self._failed = threading.Event()
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None
        self.sessions = 0
        self.losses = 0  # how often a device that worked was lost

    @property
    def alive(self) -> bool:
        """Whether the device works now."""
        return self._alive.is_set()

    @property
    def failure(self) -> BaseException | None:
        """Why the device does not work now; None while it does, or was never tried."""
        return None if self.alive else self._failure

    def start(self) -> None:
        """Begin to open the device, without waiting for it."""
        self._stop.clear()
        self._failed.clear()
        self._thread = threading.Thread(target=self._run, name=f"robot-{self.name}", daemon=True)
        self._thread.start()

    def wait_alive(self, timeout_s: float) -> None:
        """Wait until the device works. Raises what its first session failed with, or `DeviceError` after the time."""
        waited_s = 0.0
        while not self._alive.wait(LOOK_S):
            waited_s += LOOK_S
            if self._failed.is_set() and self._failure is not None:
                raise self._failure
            if waited_s > timeout_s:
                raise DeviceError(f"the {self.name} does not answer", "Check plug and power.")

    def close(self) -> None:
        """End the session, which lets go of the device, and the thread. May be called twice."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(JOIN_S)
            self._thread = None

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                self._session(self._stop, self._begin)
            except LiraError as error:
                self._failure = error
            except Exception as error:  # noqa: BLE001 - a fault in the driver: told like any other, not tried again
                self._failure = error
                return
            finally:
                self.losses += self.alive  # counted first: whoever sees it lost has the count
                self._alive.clear()
                self._failed.set()
            self._stop.wait(RETRY_S)

    def _begin(self) -> None:
        self.sessions += 1
        self._alive.set()
