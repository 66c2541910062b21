"""A driver under test: straight on at full speed, as a policy at the control rate.

It stands while a sensor is stale or unusable, like the learner, and never arms again by itself. Words: `go` arms and
drives; `leave` says farewell and falls silent; `mute` falls silent in motion; any other names a way to go wrong.

python -m tools.stop_test.driver NAME HOST:PORT EAR_PORT
"""

import math
import sys
from queue import SimpleQueue

from fusion.preprocess import Preprocessor
from hal.bus import Bus
from hal.errors import SensorError
from hal.messages import HELD, STOP, Applied, Command, Reason, Twist
from hal.remote import RemoteRobot
from hal.topics import CMD_VEL
from tools.stop_test.control import Ear, tell_time

READY = "driving by word"
FAREWELLS = 3
HOUR_S = 3600.0
TWISTS = {"nan": Twist(math.nan, 0.0), "inf": Twist(math.inf, math.inf), "1e308": Twist(1e308, 0.0)}
STAMPS_S = {"an hour ahead": HOUR_S, "an hour behind": -HOUR_S}


class Driver:
    """One commander."""

    def __init__(self, robot: RemoteRobot) -> None:
        self._robot = robot
        self._preprocess = Preprocessor(robot.profile)
        self._liar = robot.bus.publisher(CMD_VEL)  # the remote robot stamps decisions itself, and truly
        self._applied = Applied(STOP, 0.0)
        self._words: SimpleQueue[str] = SimpleQueue()
        self._word = "mute"

    def hear(self, word: str) -> None:
        """Take a word, from any thread."""
        if word == "what time":
            tell_time()
        else:
            self._words.put(word)

    def run(self) -> None:
        """Do what the words say, for ever."""
        while True:
            if not self._words.empty():
                self._word = self._words.get()
            if self._word == "leave":
                for _ in range(FAREWELLS):
                    self._drive(STOP, released=True)
                self._word = "mute"
            elif self._word != "mute" and (wish := self._wish()) is not None:
                self._drive(wish)
            self._robot.wait(self._robot.now() + self._robot.profile.period_s)

    def _wish(self) -> Twist | None:
        """What to command; None to say nothing. Zero would arm a robot that stopped by itself: only `go` does that."""
        if self._word == "go" and self._applied.reason is not Reason.OK:
            return STOP
        if not self._sees():
            return None if self._applied.reason in HELD else STOP
        return TWISTS.get(self._word, Twist(self._robot.profile.base.max_linear_m_s, 0.0))

    def _sees(self) -> bool:
        try:
            return self._preprocess(self._robot.read()) is not None
        except SensorError:
            return False

    def _drive(self, twist: Twist, *, released: bool = False) -> None:
        now_s = self._robot.now()
        if self._word in STAMPS_S:
            self._liar.put(twist, now_s + STAMPS_S[self._word])
            return
        command = Command(twist, now_s, answers=self._robot.read().seq, released=released)
        applied = self._applied = self._robot.drive(command)
        if self._word == "go" and applied.reason is Reason.OK and applied.twist != STOP:
            self._word = "drive"


def main(name: str, endpoint: str, ear_port: int) -> None:
    """Drive by word."""
    robot = RemoteRobot(Bus(name, connect=endpoint))
    robot.open()
    driver = Driver(robot)
    Ear(ear_port, driver.hear)
    print(READY, flush=True)
    driver.run()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
