"""A device, tried for a while by the driver that `lira robot` uses."""

import threading
import time
from collections.abc import Callable

from lira.hal.errors import DeviceError

Session = Callable[[threading.Event, Callable[[], None]], None]
START_S = 20.0  # a base boots, a lidar spins up
JOIN_S = 5.0
LOOK_S, POLL_S = 0.02, 0.005


def listen(session: Session, seconds: float, look: Callable[[], None] = lambda: None) -> float:
    """Run a session until it has worked for so long, and end it. Returns after how many seconds it began to work.

    `look` is called again and again once it works, for what does not come by itself.

    Raises what ended it before that: a doctor wants to know of the first fault, so nothing is tried twice.
    """
    stop, begun = threading.Event(), threading.Event()
    failures: list[Exception] = []

    def run() -> None:
        try:
            session(stop, begun.set)
        except Exception as error:  # noqa: BLE001 - raised again below
            failures.append(error)

    thread = threading.Thread(target=run, name="doctor-device", daemon=True)
    opened_s = time.monotonic()
    thread.start()
    try:
        while not begun.wait(LOOK_S) and thread.is_alive() and time.monotonic() - opened_s < START_S:
            pass
        began_s = time.monotonic() - opened_s
        while begun.is_set() and thread.is_alive() and time.monotonic() - opened_s < began_s + seconds:
            look()
            time.sleep(POLL_S)
    finally:
        stop.set()
        thread.join(JOIN_S)
    if failures:
        raise failures[0]
    if not begun.is_set():
        raise DeviceError(f"it does not begin to work within {START_S:.0f} s", "Check plug and power.")
    return began_s
