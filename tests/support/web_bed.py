"""A robot on the bus, a policy that drives it, `lira web`, and a real browser that looks at its page."""

import contextlib
import shutil
import threading
import time
from pathlib import Path

import pytest

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import APPLIED
from lira.hal.client.connect import connect
from lira.hal.messages import STOP, Command, Source, Twist
from lira.tools.bench.parts.robots import null_robot_at_work
from lira.tools.launch.processes import ChildProcess, free_port, lira_command
from lira.tools.launch.threads import in_thread

NEEDED = ("chromium", "chromedriver")
missing = [name for name in NEEDED if shutil.which(name) is None]
needs_browser = pytest.mark.skipif(bool(missing), reason=f"needs {' and '.join(missing)} (Debian)")


@contextlib.contextmanager
def policy(name, endpoint):
    """Drives on and on, and never asks a robot that has stopped to move again: that is for a person."""
    stop = threading.Event()

    def drive():
        robot.drive(Command(STOP, robot.now(), answers=robot.read().seq))
        while not stop.is_set():
            robot.drive(Command(Twist(0.3, 0.0), robot.now(), answers=robot.read().seq))
            robot.wait(robot.now() + robot.profile.period_s)

    with connect(endpoint, name) as robot, in_thread(drive, stop):
        yield


@contextlib.contextmanager
def robot_that_drives():
    """Its name, its address and the bus, while a policy drives it."""
    with null_robot_at_work() as (name, endpoint, _), contextlib.ExitStack() as stack:
        bus = Bus(name, connect=endpoint)
        stack.callback(bus.close)
        stack.enter_context(policy(name, endpoint))
        yield name, endpoint, bus


@contextlib.contextmanager
def page_of_robot(folder):
    """The bus, the page's address, and `lira web` as a process, while a policy drives the robot."""
    with robot_that_drives() as (name, endpoint, bus), contextlib.ExitStack() as stack:
        port = free_port()
        words = ["--name", name, "--connect", endpoint, "--port", str(port)]
        web = stack.enter_context(ChildProcess("lira web", lira_command("web", *words), folder / "web.log"))
        web.wait_ready("web shows", 30.0)
        yield bus, f"http://127.0.0.1:{port}", web


@contextlib.contextmanager
def browser():
    """Chromium without a screen."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(flag)
    options.add_argument("--window-size=1366,768")
    driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    try:
        yield driver
    finally:
        with contextlib.suppress(Exception):
            driver.quit()


def descendants(pid):
    """The processes that a process has started, and those that they have, as far as they still run."""
    parents = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # ended meanwhile
            parents[int(path.parent.name)] = int(path.read_text().rpartition(")")[2].split()[1])
    found = {pid}
    while new := {child for child, parent in parents.items() if parent in found} - found:
        found |= new
    return found - {pid}


def wait_until(condition, timeout_s=15.0, what=""):
    """Whatever the condition returns once it is true."""
    until_s = time.monotonic() + timeout_s
    while not (found := condition()):
        assert time.monotonic() < until_s, what or condition
        time.sleep(0.05)  # to ask a browser is not free
    return found


class Applied:
    """What the robot was told, as it says so itself: every motion with its time and whose command it was."""

    def __init__(self, bus):
        self._reader = bus.reader(APPLIED, depth=4096)
        self.all = []

    def listen(self, duration_s=0.0):
        until_s = time.monotonic() + duration_s
        while True:
            self.all += [received.message for received in self._reader.poll()]
            if time.monotonic() >= until_s:
                return self.all
            time.sleep(0.02)

    def by_hand(self):
        """Whether a hand moves it now."""
        self.listen()
        return bool(self.all) and is_by_hand(self.all[-1])

    def zero_after_s(self):
        """From the last command of the hand that moved it until it had zero, on the robot's clock."""
        moving = [index for index, each in enumerate(self.all) if is_by_hand(each)]
        last = self.all[moving[-1]]
        given_s = last.stamp_s - last.command_age_s
        zero = next(each for each in self.all[moving[-1] + 1 :] if not each.twist.linear_m_s)
        return zero.stamp_s - given_s


def is_by_hand(applied):
    """Whether this is a motion that a hand asked for."""
    return applied.source is Source.TELEOP and abs(applied.twist.linear_m_s) > 0.05
