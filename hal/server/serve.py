"""Put a robot on the bus in one call: governor, watchdog, emergency stop and all."""

import threading
from collections.abc import Callable
from contextlib import closing, nullcontext

from lira.hal.bus.bus import Bus
from lira.hal.bus.endpoint import DEFAULT_ENDPOINT, DEFAULT_ROBOT
from lira.hal.bus.security.access_log import count_refusals
from lira.hal.messages import CameraInfo
from lira.hal.port import Arena, Robot
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.server import HalServer
from lira.hal.signals import stop_on_signal


def serve(
    robot: Robot,
    name: str = DEFAULT_ROBOT,
    listen: str = DEFAULT_ENDPOINT,
    *,
    arena: Arena | None = None,
    arena_info: bytes = b"null",
    lockstep: bool = False,
    calibration: CameraInfo | None = None,
    insecure: bool = False,
    ready: Callable[[Bus, threading.Event], None] = lambda _bus, _stop: None,
    stop: threading.Event | None = None,
    alive: Callable[[], None] = lambda: None,
) -> None:
    """Open a raw robot, govern it and serve it as `name` at `listen` (HOST:PORT), until told to stop.

    `arena` is the twin behind it, if it is one, and `arena_info` JSON about its world; in `lockstep` time passes only
    when a driver has answered. `calibration` is the camera's, None for the profile's pinhole. `ready` is called with
    the bus once the robot answers, and in real time `alive` over and over by the thread that moves the wheels. Without
    `stop` Ctrl-C and SIGTERM end it, which takes the main thread. Raises `BusError`, `ConfigError` for an address that
    other machines reach without keys and without `insecure`, and whatever the robot fails with.
    """
    bus = Bus(name, listen=listen, insecure=insecure, refusals=count_refusals())
    with closing(bus), stop_on_signal() if stop is None else nullcontext(stop) as ended:
        server = HalServer(
            GovernedRobot(robot),
            bus,
            arena,
            arena_info=arena_info,
            lockstep=lockstep,
            calibration=calibration,
            ready=lambda: ready(bus, ended),
            alive=alive,
        )
        server.run(ended)
