"""The arena of a robot that knows nothing of it: the twin that is driven through its devices, on a bus of its own."""

import time
from dataclasses import replace

import msgspec

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import ask_info, reset_time
from lira.hal.bus.topics import RESET, SIM_STATE
from lira.hal.client.remote import RESET_S, RemoteRobot
from lira.hal.clock import ClockEstimate
from lira.hal.errors import BusError
from lira.hal.messages import STOP, Command, CourseState, Episode

MOMENT_S = 0.5
POLL_S = 0.002


class WiredArena:
    """Implements `hal.port.Arena`: resets and truth come over `bus` from the twin, the time is `robot`'s.

    Both stay the caller's. Raises `BusError` if no twin answers.
    """

    def __init__(self, bus: Bus, robot: RemoteRobot) -> None:
        self._bus = bus
        self._robot = robot
        self._states = bus.reader(SIM_STATE, depth=4)
        self._clock = ClockEstimate()  # the twin's
        self._newest: CourseState | None = None
        self._not_before_s = float("-inf")
        self.info = bytes(ask_info(bus).arena)

    def reset(self, episode: Episode) -> None:
        """Start afresh, with wheels that stand. Raises `BusError` if the twin refuses."""
        self._robot.drive(Command(STOP, self._robot.now()))
        answer = self._bus.ask(RESET, msgspec.json.encode(episode), timeout_s=RESET_S)
        self._not_before_s = reset_time(answer)
        # The twin answers when its devices show the new episode.
        self._robot.refresh(self._robot.now())

    def state(self) -> CourseState:
        """Ground truth now, stamped on the robot's clock. Raises `BusError` if none comes."""
        deadline_s = time.monotonic() + MOMENT_S
        while (age_s := self._listen()) is None:
            if time.monotonic() > deadline_s:
                raise BusError("the twin does not say where the robot really is", "Check that it is still running.")
            time.sleep(POLL_S)
        assert self._newest is not None
        return replace(self._newest, stamp_s=self._robot.now() - age_s)

    def _listen(self) -> float | None:
        """Take in what came; returns the age of the newest state, None if it is too old or of the last episode."""
        for received in self._states.poll():
            if received.attachment is not None:
                self._clock.note(received.attachment.time_s, received.arrived_s)
                self._newest = received.message
        if self._newest is None or self._newest.stamp_s < self._not_before_s:
            return None
        age_s = self._clock.now(time.monotonic()) - self._newest.stamp_s
        return age_s if age_s <= SIM_STATE.max_age_s else None
