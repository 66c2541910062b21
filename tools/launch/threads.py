"""Work beside the rest of a program."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def in_thread(work: Callable[[], object], stop: threading.Event) -> Iterator[None]:
    """Work in a thread until the block ends, which sets `stop` and waits for it."""
    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
