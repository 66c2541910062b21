"""Words to a process under test, as datagrams: they reach it though its bus may be broken."""

import socket
import threading
import time
from collections.abc import Callable

TIME = "the time of day here is "


class Ear:
    """Calls `hear` with every word that comes to a port of this machine, on a thread of its own."""

    def __init__(self, port: int, hear: Callable[[str], None]) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self._hear = hear
        threading.Thread(target=self._run, name="ear", daemon=True).start()

    def _run(self) -> None:
        while True:
            self._hear(self._socket.recv(256).decode())


def say(port: int, word: str) -> None:
    """Say a word to whoever has an ear there."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mouth:
        mouth.sendto(word.encode(), ("127.0.0.1", port))


def tell_time() -> None:
    """Print what this process takes the time of day for."""
    print(f"{TIME}{time.time():.0f}", flush=True)
