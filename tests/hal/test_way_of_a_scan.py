"""How many files somebody has to read to follow a scan from the sensor to the wheels, over the bus."""

import sys
import threading
from collections import defaultdict
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from wiring import real_time_null, remote, served, wait_for

from lira.hal.messages import STOP, Command, Reason, Twist
from lira.hal.testing import NullRobot

PRODUCT = Path(__file__).parent.parent.parent
FOLDERS = [PRODUCT / name for name in ("hal", "robot", "fusion", "sim_backend", "tools")]
MOST_FILES = 25
# What reads and publishes the scan, and what judges and applies the command; the driver is the test itself.
ON_THE_WAY = ("hal-sensors", "hal-commands")


@contextmanager
def traced():
    """Note in which files anything is called, by thread: of this one, and of those that start within."""
    ran = defaultdict(set)

    def note(frame, event, _):
        if event == "call":
            ran[threading.current_thread().name].add(frame.f_code.co_filename)

    threading.setprofile(note)
    sys.setprofile(note)
    try:
        yield ran
    finally:
        sys.setprofile(None)
        threading.setprofile(None)


class ScansAlone(NullRobot):
    """What else a robot senses goes other ways."""

    def read(self):
        return replace(super().read(), image=None, odom=None)


def test_the_way_of_a_scan_to_the_command_is_short():
    go = Twist(0.5, 0.0)
    driver = threading.current_thread().name
    with traced() as ran, served(real_time_null(ScansAlone), floor=True) as robot, remote(robot) as client:
        wait_for(lambda: client.drive(Command(STOP, client.now())).reason is Reason.OK)
        for files in list(ran.values()):
            files.clear()  # what opening took is not on the way
        since_s = client.now()
        wait_for(lambda: (scan := client.read().scan) is not None and scan.stamp_s > since_s)
        answers = client.read().seq
        wait_for(lambda: client.drive(Command(go, client.now(), answers=answers)).answers == answers)
        wait_for(lambda: robot.inner.state().linear_m_s == go.linear_m_s)
        way = {name: set(ran[name]) for name in (driver, *ON_THE_WAY)}
    files = {Path(name).resolve() for name in set().union(*way.values())}
    ours = sorted(str(path.relative_to(PRODUCT)) for path in files if any(map(path.is_relative_to, FOLDERS)))
    for needed in ("hal/testing.py", "hal/messages/ros/sensing.py", "hal/client/realtime.py", "hal/safety/governor.py"):
        assert needed in ours  # else nothing was followed
    assert len(ours) <= MOST_FILES, f"{len(ours)} files: {', '.join(ours)}"
