"""How a robot at the other end of the bus is reached."""

from collections.abc import Iterator
from contextlib import closing, contextmanager

from lira.hal.bus.bus import CLOSE_S, Bus
from lira.hal.bus.endpoint import DEFAULT_ENDPOINT, DEFAULT_ROBOT
from lira.hal.bus.services import INFO_S, LOCKSTEP, ask_info
from lira.hal.client.lockstep import LockstepRobot
from lira.hal.client.realtime import RealTimeRobot
from lira.hal.client.remote import RemoteRobot


def open_remote(bus: Bus, answer_s: float = INFO_S) -> RemoteRobot:
    """Open the robot on a bus, in real time or in lockstep as it has it. Raises `BusError` if none answers in time."""
    info = ask_info(bus, answer_s)
    return (LockstepRobot if info.mode == LOCKSTEP else RealTimeRobot)(bus, info)


@contextmanager
def on_bus(address: str, name: str, *, watch: bool = False, close_s: float = CLOSE_S) -> Iterator[Bus]:
    """Open a client's bus for the robot `name` that listens at `address` (HOST:PORT), and close it in the end.

    Leaving a link that is dead takes `close_s` at most.
    """
    bus = Bus(name, connect=address, watch=watch)
    try:
        yield bus
    finally:
        bus.close(close_s)


@contextmanager
def connect(
    address: str = DEFAULT_ENDPOINT, name: str = DEFAULT_ROBOT, *, close_s: float = CLOSE_S
) -> Iterator[RemoteRobot]:
    """Open the robot `name` that listens at `address` (HOST:PORT); in the end say stop, and leave it running.

    Leaving a link that is dead takes `close_s` at most. Raises `BusError` if nobody answers. Keys are those that
    LIRA_KEYS names.
    """
    with on_bus(address, name, close_s=close_s) as bus, closing(open_remote(bus)) as robot:
        yield robot
