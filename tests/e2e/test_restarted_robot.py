"""The robot is started anew under the learner, and its clock begins at 0: the learner goes on, and can be ended."""

import signal
import threading
import time
from contextlib import closing, contextmanager

from lira.fusion.log.label_log import read_demonstrations
from lira.hal.client.connect import on_bus, open_remote
from lira.hal.messages import STOP, Command, Reason, Source, Twist
from lira.tools.launch.processes import ChildProcess, free_port, lira_command
from lira.tools.launch.threads import in_thread

READY_S = 90.0
SPEED = 3.0  # the first robot's clock is soon so far that nobody would wait for it
LABELS = 10
REST_S = 0.5
END_S = 10.0  # 3 s are promised; the rest is for a busy machine


class Place:
    """A name on the bus, and the processes there."""

    def __init__(self, folder):
        port = free_port()
        self.folder, self.name, self.endpoint = folder, f"anew_{port}", f"127.0.0.1:{port}"

    @contextmanager
    def twin(self, *words):
        command = lira_command("twin", "--world", "line", "--name", self.name, "--listen", self.endpoint, *words)
        with ChildProcess("the twin", command, self.folder / "twin.log") as twin:
            twin.wait_ready("serves", READY_S)
            yield twin

    @contextmanager
    def learner(self):
        at = ["--name", self.name, "--connect", self.endpoint]
        words = [*at, "--method", "plus", "--no-record", "--run", str(self.folder / "run")]
        with ChildProcess("the learner", lira_command("fusion", *words), self.folder / "lira.fusion.log") as learner:
            learner.wait_ready("learns on", READY_S)
            yield learner

    @property
    def labels(self):
        return sum(1 for _ in read_demonstrations(self.folder / "run" / "labels.lira"))

    def wait_for_labels(self, count, timeout_s, learner):
        until_s = time.monotonic() + timeout_s
        while self.labels < count:
            assert time.monotonic() < until_s, (self.labels, learner.output())
            time.sleep(0.1)


@contextmanager
def hand(place):
    """Holds the dead-man: at rest for a moment, then ahead; and so again where the robot stands and wants it."""
    stop = threading.Event()

    def drive():
        rest_until_s = time.monotonic() + REST_S
        while not stop.wait(1 / 30):
            moves = time.monotonic() >= rest_until_s
            applied = robot.drive(Command(Twist(0.2, 0.0) if moves else STOP, robot.now(), Source.TELEOP))
            if moves and applied.reason is not Reason.OK:
                rest_until_s = time.monotonic() + REST_S

    with (
        on_bus(place.endpoint, place.name) as bus,
        closing(open_remote(bus, answer_s=READY_S)) as robot,
        in_thread(drive, stop),
    ):
        yield


def assert_ends(learner, number):
    began_s = time.monotonic()
    learner.signal(number)
    assert learner.wait(20.0) == 0, learner.output()
    assert time.monotonic() - began_s < END_S
    assert "saved" in learner.output()
    assert "Traceback" not in learner.output()


def test_the_learner_goes_on_and_learns_from_a_robot_that_was_started_anew(tmp_path):
    place = Place(tmp_path)
    with place.twin("--speed", str(SPEED)) as twin, place.learner() as learner:
        with hand(place):
            place.wait_for_labels(LABELS, 60.0, learner)
        time.sleep(3.0)
        twin.signal(signal.SIGKILL)
        twin.wait(5.0)
        before = place.labels
        with place.twin():
            learner.wait_ready("started anew", 60.0)
            with hand(place):
                place.wait_for_labels(before + LABELS, 60.0, learner)
            assert_ends(learner, signal.SIGINT)


def test_the_learner_ends_after_its_robot_was_started_anew(tmp_path):
    place = Place(tmp_path)
    with place.twin("--speed", str(SPEED)) as twin, place.learner() as learner:
        time.sleep(2.0)
        twin.signal(signal.SIGKILL)
        twin.wait(5.0)
        with place.twin():
            assert_ends(learner, signal.SIGTERM)
