"""Hears a robot's bus, and writes down twice a second how often and how lately each topic came, and who drives.

`lira status` reads that instead of opening a bus, so it answers at once. Pictures are listened to on this machine only:
over the radio they would be sent once more.

python -m lira.tools.lifecycle.watch.monitor NAME HOST:PORT
"""

import sys
import threading
import time
from typing import Any

from lira.hal.bus.bus import Bus
from lira.hal.bus.endpoint import is_loopback
from lira.hal.bus.sensors import Sensor, sensors_of
from lira.hal.bus.topics import APPLIED, DECISION, DIAGNOSTICS, OPERATOR_ANSWER, SESSION, SIM_STATE
from lira.hal.errors import LiraError
from lira.hal.messages import Reason
from lira.hal.profile import RobotProfile
from lira.tools.launch.lifetime import process
from lira.tools.launch.notify import Notifier
from lira.tools.lifecycle.folder import StateFolder
from lira.tools.lifecycle.records import HEARD, Heard
from lira.tools.lifecycle.watch.line import Line
from lira.tools.operator.beside import beside
from lira.tools.operator.view import View
from lira.tools.operator.voice import speak

POLL_S = 0.1
WRITE_S = 0.5


def rate_of(sensor: Sensor, profile: RobotProfile) -> float | None:
    """How often the robot of a profile measures with a sensor; None where the profile does not say."""
    part = getattr(profile, "lidar" if sensor.name == "scan" else sensor.name, None)
    return getattr(part, "rate_hz", None)


class Monitor:
    """Listens to a robot's sensors, and to what tells who drives and how it is."""

    def __init__(self, bus: Bus, profile: RobotProfile, *, pictures: bool) -> None:
        self._robot = bus.robot
        self._applied, self._decision = Line(bus, APPLIED), Line(bus, DECISION)
        self._session, self._answer = Line(bus, SESSION), Line(bus, OPERATOR_ANSWER)
        self._diagnostics, self._truth = Line(bus, DIAGNOSTICS), Line(bus, SIM_STATE)
        sensors = [sensor for sensor in sensors_of(profile) if pictures or sensor.compress is None]
        self._lines: list[Line[Any]] = [Line(bus, sensor.topic, rate_of(sensor, profile)) for sensor in sensors]
        self._lines += [self._applied, self._decision, self._session, self._answer, self._diagnostics, self._truth]

    def listen(self) -> None:
        """Take in what came."""
        for line in self._lines:
            line.listen()

    def heard(self, now_s: float) -> Heard:
        """What there is to tell."""
        view = self._view(now_s)
        voice, parts = speak(view), self._parts(now_s)
        topics = tuple(line.state(now_s) for line in self._lines)
        governor, link = parts.get("governor", ""), parts.get("link", "")
        return Heard(now_s, topics, link, governor, voice.situation, voice.urgency, voice.who, voice.why, voice.now)

    def _view(self, now_s: float) -> View:
        applied = self._applied.newest
        return View(
            self._robot,
            applied=applied,
            link_age_s=now_s - self._applied.arrived_s,
            decision=self._decision.newest,
            decision_age_s=now_s - self._decision.arrived_s,
            session=self._session.newest,
            session_age_s=now_s - self._session.arrived_s,
            answer=self._answer.newest,
            answer_age_s=now_s - self._answer.arrived_s,
            truth=self._truth.newest,
            truth_age_s=now_s - self._truth.arrived_s,
            estop=applied is not None and applied.reason is Reason.ESTOP,
        )

    def _parts(self, now_s: float) -> dict[str, str]:
        """What the robot says of its parts, by name; nothing if that is old."""
        said = self._diagnostics.newest
        if said is None or now_s - self._diagnostics.arrived_s > DIAGNOSTICS.max_age_s:
            return {}
        return {status.name.rpartition(": ")[2]: status.message for status in said.status}


def run(monitor: Monitor, folder: StateFolder, stop: threading.Event, notifier: Notifier) -> None:
    """Listen and write down until `stop` is set. Raises `StorageError`."""
    due_s = 0.0
    while not stop.wait(POLL_S):
        monitor.listen()
        now_s = time.monotonic()
        if now_s >= due_s:
            due_s = now_s + WRITE_S
            folder.write(HEARD, monitor.heard(now_s))
        notifier.alive()


def main(name: str, endpoint: str) -> int:
    """Monitor until told to stop."""
    folder, notifier = StateFolder(name), Notifier.from_environment()
    folder.make()
    try:
        with beside(name, endpoint) as robot:
            monitor = Monitor(robot.watch, robot.info.profile, pictures=is_loopback(endpoint))
            words = f"monitor hears '{name}' at {endpoint}"
            print(words, flush=True)
            notifier.ready(words)
            run(monitor, folder, robot.stop, notifier)
    except LiraError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    process(lambda: main(*sys.argv[1:]))
