"""A driver under test: straight on at full speed, as a policy at the control rate, ruled by control messages.

`go` arms and drives; `drive` drives, and stands while a sensor is stale or unusable, like the learner; `insist` asks
for motion whatever happens, and never for zero; `waver` asks for motion and zero in turn; `leave` says farewell and
falls silent; `mute` falls silent in motion; `hang` does nothing any more, as a loop that never comes back. Any other
names a command to send that may not be obeyed (`TWISTS`, `STAMPS_S`).

python -m lira.tools.stop_test.parts.driver NAME HOST:PORT CONTROL_PORT JOURNAL
"""

import math
import sys
import time
from pathlib import Path
from queue import SimpleQueue

from lira.fusion.preprocess import Preprocessor
from lira.hal.bus.bus import Bus
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.topics import CMD_VEL
from lira.hal.client.connect import open_remote
from lira.hal.client.remote import RemoteRobot
from lira.hal.errors import SensorError
from lira.hal.messages import HELD, STOP, Applied, Command, Reason, Twist
from lira.tools.stop_test.control import ASK_TIME, listen, print_time
from lira.tools.stop_test.parts.sender import Pen, note_commands

READY = "driving by word"
FAREWELLS = 3
HANG_S = 2.0
WAVER_S = 0.05
TWISTS = {"nan": Twist(math.nan, 0.0), "inf": Twist(math.inf, math.inf), "1e308": Twist(1e308, 0.0)}
STAMPS_S = {"an hour ahead": 3600.0, "an hour behind": -3600.0, "half a second ahead": 0.5}


class Driver:
    """One commander."""

    def __init__(self, robot: RemoteRobot, lies: Publisher[Twist], liar: Pen) -> None:
        self._robot = robot
        self._lies, self._liar = lies, liar
        self._preprocess = Preprocessor(robot.profile)
        self._wheel = robot.bus.publisher(CMD_VEL)  # past the remote robot, which keeps back what may arm unasked
        self._applied = Applied(STOP, 0.0)
        self._words: SimpleQueue[str] = SimpleQueue()
        self._word = "mute"
        self._count = 0

    def hear(self, word: str) -> None:
        """Take a control message, from any thread."""
        if word == ASK_TIME:
            print_time()
        else:
            self._words.put(word)

    def run(self) -> None:
        """Do what was said last, for ever."""
        while True:
            if not self._words.empty():
                self._word = self._words.get()
            self._act()
            pause_s = WAVER_S if self._word == "waver" else self._robot.profile.period_s
            self._robot.wait(self._robot.now() + pause_s)

    def _act(self) -> None:
        self._count += 1
        if self._word == "leave":
            for _ in range(FAREWELLS):
                self._drive(STOP, released=True)
            self._word = "mute"
        elif self._word == "hang":
            time.sleep(HANG_S)
        elif self._word in STAMPS_S:
            self._lie(STAMPS_S[self._word])
        elif self._word == "waver":
            self._wheel.put(self._full() if self._count % 2 else STOP, self._robot.now())
        elif self._word != "mute" and (wish := self._wish()) is not None:
            self._drive(wish)

    def _full(self) -> Twist:
        return Twist(self._robot.profile.base.max_linear_m_s, 0.0)

    def _wish(self) -> Twist | None:
        """What to command; None to say nothing. Zero would arm a robot that stopped by itself: only `go` does that."""
        if self._word == "insist":
            return self._full()
        if self._word == "go" and self._applied.reason is not Reason.OK:
            return STOP
        if not self._sees():
            return None if self._applied.reason in HELD else STOP
        return TWISTS.get(self._word, self._full())

    def _sees(self) -> bool:
        try:
            return self._preprocess(self._robot.read()) is not None
        except SensorError:
            return False

    def _drive(self, twist: Twist, *, released: bool = False) -> None:
        command = Command(twist, self._robot.now(), answers=self._robot.read().seq, released=released)
        applied = self._applied = self._robot.drive(command)
        if self._word == "go" and applied.reason is Reason.OK and applied.twist != STOP:
            self._word = "drive"

    def _lie(self, ahead_s: float) -> None:
        """Command with a wrong time: whoever obeys it obeys a liar."""
        self._lies.put(self._liar.mark(self._full()), max(self._robot.now() + ahead_s, 0.0))


def main(name: str, endpoint: str, control_port: int, journal: Path) -> None:
    """Drive by control messages."""
    bus = Bus(name, connect=endpoint)
    lies = bus.publisher(CMD_VEL)  # what goes out here is noted as a liar's; from now on all is the driver's
    note_commands(journal, "driver")
    robot = open_remote(bus)
    driver = Driver(robot, lies, Pen(journal, "liar"))
    listen(control_port, driver.hear)
    print(READY, flush=True)
    driver.run()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), Path(sys.argv[4]))
