"""Plays a recording on a bus of its own: all that was told, to the byte, when it was told."""

import threading
import time
from collections.abc import Callable, Iterator

import msgspec

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import LOCKSTEP
from lira.hal.bus.topics import DECISION
from lira.hal.server.info_service import InfoService
from lira.tools.recording.reader import Recorded, Recording, topic_of

AGAIN_S = 1.0  # latched values are told again, for who comes late
POLL_S = 0.005
LEAD_S = 0.3  # a bus has to meet its peers before anything is told


class Player:
    """Tells a recording on `bus`. `speed` is in times of the robot's; nobody drives what is played.

    Attachments are those of then: a reader sees who sent what, in which order and when, and how old a stamp was.
    """

    def __init__(self, recording: Recording, bus: Bus, *, speed: float = 1.0) -> None:
        self._recording, self._bus, self._speed = recording, bus, speed
        # Nobody's hand can follow, as with a twin in lockstep: screens then offer none.
        info = msgspec.structs.replace(recording.head.info, mode=LOCKSTEP)
        self._service = InfoService(bus, info, None, lambda: 0.0)
        self._latched: dict[str, Recorded] = {}
        self._again_s = time.monotonic()
        self.told = 0

    def run(self, stop: threading.Event, since_s: float = 0.0) -> None:
        """Play from so many seconds after the beginning until the end, or until `stop` is set."""
        self._pause(stop, LEAD_S)
        began_s, first_s = time.monotonic(), None
        for each in self._messages(since_s):
            first_s = each.arrived_s if first_s is None else first_s
            self._pause(stop, began_s + (each.arrived_s - first_s) / self._speed - time.monotonic())
            if stop.is_set():
                return
            self._tell(each)

    def step(self, stop: threading.Event, ask: Callable[[Recorded], bool], since_s: float = 0.0) -> None:
        """Play from decision to decision: after each `ask` says whether to go on to the next."""
        self._pause(stop, LEAD_S)
        for each in self._messages(since_s):
            if stop.is_set():
                return
            self._tell(each)
            if each.key == DECISION.key and not ask(each):
                return

    def serve(self) -> None:
        """Answer who asks, and tell late comers what is latched."""
        self._service.serve(lambda: None)
        now_s = time.monotonic()
        if now_s - self._again_s > AGAIN_S:
            self._again_s = now_s
            for each in self._latched.values():
                self._put(each)

    def _messages(self, since_s: float) -> Iterator[Recorded]:
        """From there on, and what was latched before."""
        since_s += self._recording.head.began_s
        for each in self._recording.messages():
            topic = topic_of(each.key)
            if each.arrived_s >= since_s or (topic is not None and topic.qos.latched):
                yield each

    def _pause(self, stop: threading.Event, seconds: float) -> None:
        until_s = time.monotonic() + seconds
        self.serve()
        while (left_s := until_s - time.monotonic()) > 0 and not stop.wait(min(left_s, POLL_S)):
            self.serve()

    def _tell(self, each: Recorded) -> None:
        topic = topic_of(each.key)
        if topic is None or topic.ros_type != each.ros_type:
            return  # nobody on this bus would hear it
        if topic.qos.latched:
            self._latched[each.key] = each
        self._put(each)
        self.told += 1

    def _put(self, each: Recorded) -> None:
        topic = topic_of(each.key)
        assert topic is not None
        self._bus.put_raw(topic, each.payload, each.beside)
