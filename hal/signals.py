"""Signals that ask a process to end, heard so that nothing can block it.

A handler runs in the main thread, between any two of its instructions and also within another handler: a terminal, a
supervisor and a person often ask at once. So it takes no lock. What it interrupts may hold that lock already; then the
main thread waits for itself, and every thread that looks at the same event waits with it, the wheels' own as well.
"""

import _thread
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

AT_ONCE_S = 0.5
Handler = Callable[[int, FrameType | None], None]


@contextmanager
def handling(handler: Handler, *numbers: int) -> Iterator[None]:
    """Handle these signals like this for a while. Needs the main thread."""
    before = [signal.signal(number, handler) for number in numbers]
    try:
        yield
    finally:
        for number, earlier in zip(numbers, before, strict=True):
            signal.signal(number, earlier)


class Asked:
    """When a signal last asked this process to end.

    What follows so soon is the same request, and cuts nothing short that the first has set off.
    """

    def __init__(self) -> None:
        self._at_s = -math.inf

    def again(self) -> bool:
        """Whether the signal that has just come says nothing new."""
        now_s = time.monotonic()
        if now_s - self._at_s < AT_ONCE_S:
            return True
        self._at_s = now_s
        return False

    def forget(self) -> None:
        """From now on any signal is new."""
        self._at_s = -math.inf


asked = Asked()


@contextmanager
def stop_on_signal() -> Iterator[threading.Event]:
    """Give an event that SIGTERM, Ctrl-C and a lost terminal set, for the main thread of a process that serves."""
    stop = threading.Event()

    def handle(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - the signature is Python's
        if not asked.again():
            set_from_handler(stop)

    asked.forget()
    with handling(handle, signal.SIGTERM, signal.SIGINT, *heeded(signal.SIGHUP)):
        yield stop


def set_from_handler(event: threading.Event) -> None:
    """Set an event, in a thread of its own: `Event.set` takes the lock that `wait` and `set` take, too."""
    _thread.start_new_thread(event.set, ())


def heeded(*numbers: int) -> list[int]:
    """Those of some signals that whoever started the process did not tell it to ignore, as nohup does."""
    return [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]
