"""What a person asks is done between two steps, answered with a line, and moves nothing without a neutral command."""

import contextlib
import threading
import time
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import pytest

from lira.fusion.control import ControlLoop
from lira.fusion.log.recorder import Journal
from lira.fusion.methods.base import Alone
from lira.fusion.operator_service import OperatorService, RequestLine
from lira.fusion.service import serve
from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import OPERATOR, OPERATOR_ANSWER
from lira.hal.errors import BusError, StorageError
from lira.hal.messages import STOP, OperatorRequest, Reason, Request, Twist
from lira.hal.messages.ros.codec import encode
from lira.hal.profile import load_profile
from lira.hal.testing import NullRobot
from lira.tools.launch.processes import free_port

PROFILE = load_profile("thesis-sim")
GO = (0.5, 0.0)


class Script:
    """A line on which these things are asked, one list before each step; then the service is stopped."""

    def __init__(self, *script, in_time=True):
        self.script, self.in_time = list(script), in_time
        self.stop, self.answers = threading.Event(), []

    def poll(self):
        asked = self.script.pop(0)
        if not self.script:
            self.stop.set()
        return [(request, self.in_time) for request in asked]

    def put(self, **answer):
        if not self.answers or self.answers[-1] != answer:
            self.answers.append(answer)


def ask(request, name=""):
    return [OperatorRequest(request, name)]


class Drives(NullRobot):
    """Keeps what it is told, and stops by itself with the `held` reason."""

    held = None

    def __init__(self):
        super().__init__(PROFILE)
        self.twists = []

    def drive(self, command):
        self.twists.append(command.twist)
        applied = super().drive(command)
        return applied if self.held is None else replace(applied, twist=STOP, reason=self.held)


@dataclass
class Learner:
    """A method that counts what happens to it."""

    resets: int = 0
    chosen: list = field(default_factory=list)

    def reset(self):
        self.resets += 1

    def update(self, now_s):
        pass

    def propose(self, features):
        return Alone("novice", lambda _: GO).propose(features)

    def learn(self, proposal, human):
        return Alone("novice", lambda _: GO).learn(proposal, human)


class Choosing(Learner):
    offers = MappingProxyType({"camera": None})

    def choose(self, name):
        self.chosen.append(name)
        return None if name == "camera" else f"no expert is called '{name}'"


class Run:
    def __init__(self, line, method=None, robot=None, *, begins=False, **words):
        self.line, self.method, self.robot = line, method or Learner(), robot or Drives()
        self.said, self.written = [], []
        journal, loop = Journal(write=self.written.append), ControlLoop(self.robot)
        self.service = OperatorService(line, loop, self.method, journal, self.said.append, **words)
        with contextlib.closing(self.service):
            if begins:
                self.service.begin()
            serve(loop, self.method, journal, line.stop, lambda _: None, operator_service=self.service)

    @property
    def laps(self):
        return [record.decision.lap for record in self.written]


GO_TWIST = Twist(0.5, 0.0)


def test_paused_it_stands_learns_nothing_and_goes_on_after_a_neutral_command():
    line = Script([], ask(Request.PAUSE), [], ask(Request.PAUSE), ask(Request.RESUME), [])
    run = Run(line)
    # One step, three paused ones, a neutral command, two steps.
    assert run.robot.twists == [GO_TWIST, STOP, STOP, STOP, STOP, GO_TWIST, GO_TWIST]
    assert len(run.written) == 3
    assert run.method.resets == 1
    assert [answer["paused"] for answer in line.answers] == [False, True, True, False]
    assert [answer["count"] for answer in line.answers] == [0, 1, 2, 3]
    assert run.said[0].startswith("operator: paused: the robot stands")
    assert run.said[-1] == "operator: it drives and learns again"


def test_who_begins_paused_says_nothing_to_the_robot_until_a_person_asks_to_go_on():
    run = Run(Script([], [], ask(Request.RESUME), []), begins=True, paused=True)
    assert run.robot.twists == [STOP, GO_TWIST, GO_TWIST]
    assert run.line.answers[0]["paused"]


def test_who_begins_as_usual_arms_and_drives():
    assert Run(Script([], []), begins=True).robot.twists == [STOP, GO_TWIST, GO_TWIST]


def test_to_go_on_when_nothing_was_paused_changes_nothing():
    run = Run(Script([], ask(Request.RESUME), []))
    assert run.robot.twists == [GO_TWIST] * 3
    assert run.method.resets == 0


def test_a_pause_does_not_arm_a_robot_that_stopped_by_itself_and_the_person_who_ends_it_does():
    robot = Drives()
    robot.held = Reason.STALE
    run = Run(Script([], ask(Request.PAUSE), [], ask(Request.RESUME)), robot=robot)
    # What was refused; the neutral command at the end, once more since it is not obeyed; the next.
    assert run.robot.twists == [GO_TWIST, STOP, STOP, GO_TWIST]


def test_a_reset_puts_a_twin_back_and_begins_an_episode_after_a_neutral_command():
    starts = []
    run = Run(Script([], ask(Request.RESET), []), restart=lambda: starts.append(len(starts)))
    assert starts == [0]
    assert run.robot.twists == [GO_TWIST, STOP, STOP, GO_TWIST, GO_TWIST]
    assert run.laps == [0, 1, 1]
    assert run.method.resets == 1
    assert run.said == ["operator: episode 1 begins, back at the start"]


def test_on_a_real_floor_a_reset_is_a_mark():
    run = Run(Script(ask(Request.RESET), ask(Request.RESET)))
    assert run.laps == [1, 2]
    assert run.said == ["operator: episode 1 begins here", "operator: episode 2 begins here"]


def test_a_reset_while_paused_leaves_it_paused():
    run = Run(Script(ask(Request.PAUSE), ask(Request.RESET), []), restart=lambda: None)
    assert set(run.robot.twists) == {STOP}
    assert run.service.paused
    assert run.written == []


def test_a_reset_that_fails_is_refused_and_the_episode_goes_on():
    def restart():
        raise BusError("the twin is gone", "Start it.")

    run = Run(Script(ask(Request.RESET), []), restart=restart)
    assert run.line.answers[-1]["accepted"] is False
    assert run.said == ["operator: not reset: the twin is gone. Start it."]
    assert run.laps == [0, 0]


def test_what_is_saved_is_taken_at_once_and_written_aside():
    written, gate, threads = [], threading.Event(), set()

    def snapshot():
        stamp = len(written)

        def write():
            assert gate.wait(5.0)
            threads.add(threading.current_thread())
            written.append(stamp)
            return "saved"

        return write

    line = Script(ask(Request.SAVE), ask(Request.SAVE), [])
    line.stop.set = lambda real=line.stop.set: (gate.set(), real())
    run = Run(line, snapshot=snapshot)
    assert len(run.written) == 3  # it drove on meanwhile
    assert written == [0]
    assert threads.isdisjoint({threading.main_thread()})
    assert run.said == ["operator: saved"]


def test_a_disk_that_is_full_is_said_and_it_drives_on():
    def write():
        raise StorageError("cannot write novice", "Free some space.")

    run = Run(Script(ask(Request.SAVE), [], []), snapshot=lambda: write)
    assert run.said == ["operator: not saved: cannot write novice. Free some space."]
    assert run.line.answers[-1]["accepted"] is False
    assert len(run.written) == 3


def test_where_nothing_is_learned_nothing_is_saved():
    assert "nothing is learned here" in Run(Script(ask(Request.SAVE))).said[0]


@pytest.mark.parametrize(
    ("method", "name", "accepted", "words"),
    [
        (Choosing(), "camera", True, "camera drives"),
        (Choosing(), "sonar", False, "no expert is called 'sonar'"),
        (Learner(), "camera", False, "this method gives no expert control"),
    ],
)
def test_an_expert_gets_the_wheel_if_the_method_can(method, name, accepted, words):
    run = Run(Script(ask(Request.HANDOVER, name)), method)
    assert run.method.chosen == ([name] if isinstance(method, Choosing) else [])
    assert (run.line.answers[-1]["accepted"], run.line.answers[-1]["words"]) == (accepted, words)


def test_a_paused_service_gives_nobody_the_wheel():
    run = Run(Script(ask(Request.PAUSE), ask(Request.HANDOVER, "camera")), Choosing())
    assert run.method.chosen == []
    assert run.said[-1] == "operator: paused: nobody drives"


@pytest.mark.parametrize("request_", list(Request))
def test_what_comes_too_late_is_not_done(request_):
    run = Run(Script(ask(request_, "camera"), in_time=False), Choosing(), snapshot=lambda: lambda: "saved")
    assert run.said == [f"operator: {request_} came too late: ask again"]
    assert (run.service.paused, run.service.episode, run.method.chosen) == (False, 0, [])


def wait_for(condition):
    deadline_s = time.monotonic() + 10.0
    while not (result := condition()):
        assert time.monotonic() < deadline_s, "never happened"
        time.sleep(0.01)
    return result


def test_over_the_bus_a_request_is_judged_by_when_it_was_sent():
    endpoint, clock_s = f"127.0.0.1:{free_port()}", 100.0
    robot = Bus("asked", listen=endpoint)
    service, watch, pad = Bus("asked", connect=endpoint), None, Bus("asked", connect=endpoint)
    try:
        wait_for(lambda: service.peers() and pad.peers())
        watch = Bus("asked", connect=endpoint, watch=True)
        line, publisher = RequestLine(service, watch, lambda: clock_s), pad.publisher(OPERATOR)
        answers = watch.reader(OPERATOR_ANSWER)
        wait_for(lambda: publisher.matching)
        for age_s in (0.5, 1.5):
            publisher.put(OperatorRequest(Request.PAUSE), clock_s - age_s)
        heard = []
        wait_for(lambda: heard.extend(line.poll()) or len(heard) == 2)
        pad.put_raw(OPERATOR, encode(OperatorRequest(Request.RESUME)))  # as a ROS peer does
        wait_for(lambda: heard.extend(line.poll()) or len(heard) == 3)
        assert [(asked.request, in_time) for asked, in_time in heard] == [
            (Request.PAUSE, True), (Request.PAUSE, False), (Request.RESUME, True),
        ]  # fmt: skip
        line.put(paused=True, count=1, accepted=True, words="paused")
        answer = wait_for(answers.newest).message
        assert (answer.stamp_s, answer.paused, answer.words) == (clock_s, True, "paused")
    finally:
        for bus in (watch, pad, service, robot):
            if bus is not None:
                bus.close()
