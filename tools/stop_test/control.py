"""Control messages to a process under test, as datagrams: they reach it though its bus may be broken."""

import socket
import threading
import time
from collections.abc import Callable

TIME = "the time of day here is "
ASK_TIME = "what time"


def listen(port: int, hear: Callable[[str], None]) -> None:
    """Call `hear` with every message that comes to a port of this machine, on a thread of its own."""
    inbox = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    inbox.bind(("127.0.0.1", port))

    def run() -> None:
        while True:
            hear(inbox.recv(256).decode())

    threading.Thread(target=run, name="control", daemon=True).start()


def tell(port: int, message: str) -> None:
    """Send a control message to whoever listens there."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as outbox:
        outbox.sendto(message.encode(), ("127.0.0.1", port))


def print_time() -> None:
    """Print what this process takes the time of day for."""
    print(f"{TIME}{time.time():.0f}", flush=True)
