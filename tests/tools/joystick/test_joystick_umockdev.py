"""The bridge on the kernel's own events: discovery, driving, unplug, return, freeze, second node, permission."""

import itertools
import json
import os
import signal
import statistics
import threading
import time

import pytest
from pad_bed import HAT, PAD_AXES, SONY, Bed, library

from lira.hal.bus.bus import Bus
from lira.hal.bus.services import look_at_estop
from lira.hal.bus.topics import APPLIED, JOY, OPERATOR, TELEOP
from lira.hal.messages import STOP, OperatorRequest, Reason, Request, Source
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.hal.server.server import HalServer
from lira.hal.testing import NullRobot
from lira.tools.launch.processes import ChildProcess, free_port, lira_command

pytestmark = pytest.mark.slow

if library() is None:
    pytest.skip("needs libumockdev (Debian package umockdev)", allow_module_level=True)

PAD, MOTION = 5, 4
AS_A_USER = ["setpriv", "--bounding-set=-dac_override,-dac_read_search"] if os.geteuid() == 0 else []
NUMBERS = itertools.count()


def wait_for(condition, why=lambda: "never happened", timeout_s=20.0):
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline_s, why()
        time.sleep(0.01)


@pytest.fixture(scope="module")
def robot():
    """The robot's own bus: what it is commanded, nobody else hears."""
    bus = Bus(f"pad{os.getpid()}", listen=f"127.0.0.1:{free_port()}")
    stop, ready = threading.Event(), threading.Event()
    inner = NullRobot(load_profile("thesis-sim"), time.monotonic, time.sleep)
    server = threading.Thread(target=HalServer(GovernedRobot(inner), bus, ready=ready.set).run, args=[stop])
    server.start()
    assert ready.wait(10.0)
    yield bus
    stop.set()
    server.join(10.0)
    assert bus.close()


@pytest.fixture(scope="module")
def address(robot):
    return robot.robot, robot.endpoint


@pytest.fixture(scope="module")
def bus(address):
    bus = Bus(address[0], connect=address[1], watch=True)
    yield bus
    bus.close()


@pytest.fixture
def bed(tmp_path):
    bed = Bed(tmp_path)
    yield bed
    bed.close()


class Watcher:
    """What came over the bus, with its time of arrival."""

    def __init__(self, bus, topic):
        self._reader = bus.reader(topic, depth=256)
        self._all = []

    def all(self):
        self._all += self._reader.poll()
        return self._all

    def last(self):
        return self.all()[-1].message if self.all() else None


class Rig:
    def __init__(self, bed, bus, robot, process):
        self.bed, self.process = bed, process
        self.applied, self.teleop, self.joy = Watcher(bus, APPLIED), Watcher(robot, TELEOP), Watcher(bus, JOY)
        self.asked = Watcher(bus, OPERATOR)
        self.pushed, self.since = 128, 0

    def says(self, words, times=1):
        output = self.process.output
        wait_for(lambda: output().count(words) >= times, lambda: f"{words!r} not in:\n{output()}")

    def drives(self, linear_m_s):
        """Wait until it does. A machine that was busy may have stopped it: then the stick goes back to rest first."""

        def driving():
            applied = self.applied.last()
            if self.stalled():
                self.bed.axis(PAD, "ABS_Y", 128)
                wait_for(lambda: self.applied.last().reason is Reason.OK, self.process.output)
                self.push(self.pushed)
            by_hand = applied is not None and applied.source is Source.TELEOP
            return by_hand and applied.twist.linear_m_s == pytest.approx(linear_m_s)

        wait_for(driving, self.process.output)

    def push(self, value):
        self.pushed, self.since = value, len(self.applied.all())
        self.bed.axis(PAD, "ABS_Y", value)

    def stalled(self):
        """Whether the robot has missed a command since the stick was pushed."""
        reasons = [received.message.reason for received in self.applied.all()[self.since :]]
        return self.pushed != 128 and Reason.STALE in reasons and reasons[-1] is Reason.NEUTRAL_FIRST

    def stands(self):
        wait_for(lambda: (a := self.applied.last()) and a.twist == STOP, self.process.output)

    def begin(self):
        """Hold the dead-man with the stick at rest, then go."""
        self.bed.key(PAD, "BTN_TL", 1)
        self.says("you drive")
        self.drives(0.0)
        self.push(0)
        self.drives(0.5)

    def begin_again(self):
        """As `begin`, after the pad was lost."""
        self.bed.key(PAD, "BTN_TL", 1)
        self.says("you drive", times=2)
        self.push(0)
        self.drives(0.5)

    def let_go(self):
        self.push(128)
        self.bed.key(PAD, "BTN_TL", 0)

    def zeros_then_silence(self, released):
        """After the last motion come zeros for half a second, and then nothing."""
        time.sleep(1.0)
        sent = self.teleop.all()
        zeros = list(itertools.takewhile(lambda r: r.message == STOP, reversed(sent)))
        assert 8 <= len(zeros) <= 18, self.process.output()
        assert {r.attachment.released for r in zeros} == {released}
        assert zeros[0].attachment.time_s - zeros[-1].attachment.time_s == pytest.approx(0.5, abs=0.15)
        time.sleep(0.3)
        assert len(self.teleop.all()) == len(sent)


@pytest.fixture
def start(bed, bus, robot, address, tmp_path):
    running = []

    def start(*words, prefix=()):
        command = lira_command("joystick", "--name", address[0], "--connect", address[1], *words)
        process = ChildProcess("the bridge", [*prefix, *bed.environment, *command], tmp_path / f"{next(NUMBERS)}.log")
        running.append(process)
        return Rig(bed, bus, robot, process)

    yield start
    for process in running:
        process.stop()
        assert "Traceback" not in process.output()


@pytest.fixture
def rig(bed, start):
    bed.plug(3, "A keyboard", keys=list(range(1, 120)), uniq="")
    bed.plug(MOTION, f"{SONY} Motion Sensors", motion=True)
    bed.plug(PAD)
    rig = start()
    rig.says("ready: hold the dead-man")
    return rig


def test_the_pad_is_found_by_its_controls_and_drives(rig):
    rig.says(f"pad: {SONY} (/dev/input/event5), with motion sensors")
    rig.begin()
    rig.bed.key(PAD, "BTN_TR", 1)
    rig.drives(1.0)
    rig.bed.axis(PAD, "ABS_X", 255)
    wait_for(lambda: rig.applied.last().twist.angular_rad_s == pytest.approx(-1.0))
    joy = rig.joy.last()
    assert joy.axes[:2] == pytest.approx((-1.0, 1.0))
    assert [i for i, pressed in enumerate(joy.buttons) if pressed] == [4, 5]
    stamps = [received.attachment.time_s for received in rig.joy.all()]
    rig.bed.key(PAD, "BTN_TL", 0)
    rig.stands()
    rig.zeros_then_silence(released=True)
    rate_hz = 1.0 / statistics.median(
        after - before for before, after in itertools.pairwise(stamps)
    )  # the machine may stall
    assert 20.0 < rate_hz < 36.0


def test_unplugged_it_stands_at_once_and_the_same_pad_takes_it_up_again(rig):
    rig.begin()
    rig.bed.unplug(PAD)
    rig.bed.unplug(MOTION)
    rig.stands()
    rig.zeros_then_silence(released=False)
    assert rig.applied.last().reason is Reason.STALE
    # Another pad is not taken for it.
    rig.bed.plug(6, "Another pad", uniq="99")
    time.sleep(0.7)
    rig.bed.key(6, "BTN_TL", 1)
    rig.bed.axis(6, "ABS_Y", 0)
    back = 8  # the kernel gives it another number
    rig.bed.plug(7, f"{SONY} Motion Sensors", motion=True)
    rig.bed.plug(back)
    # The dead-man is still held when it comes back: nothing moves before it was let go.
    rig.bed.key(back, "BTN_TL", 1)
    rig.says("(/dev/input/event8), with motion sensors")
    time.sleep(0.8)
    assert rig.applied.last().twist == STOP
    rig.bed.key(back, "BTN_TL", 0)
    rig.says("ready: hold the dead-man", times=2)
    rig.bed.key(back, "BTN_TL", 1)
    rig.says("you drive", times=2)
    rig.drives(0.0)
    rig.bed.axis(back, "ABS_Y", 0)
    rig.drives(0.5)
    assert "Another pad" not in rig.process.output()


def test_a_frozen_pad_stands_and_drives_again_when_it_is_back(rig):
    rig.begin()
    rig.bed.freeze(MOTION)
    rig.stands()
    rig.says("the pad is frozen")
    rig.zeros_then_silence(released=False)
    joys = len(rig.joy.all())
    time.sleep(0.2)
    assert len(rig.joy.all()) == joys
    rig.bed.thaw(MOTION)
    rig.let_go()
    rig.says("ready: hold the dead-man", times=2)
    rig.bed.key(PAD, "BTN_TL", 1)
    rig.says("you drive", times=2)


def test_the_emergency_stop_and_its_release(rig, bus):
    rig.begin()
    rig.bed.key(PAD, "BTN_MODE", 1)
    rig.says("emergency stop: the robot stands (confirmed by the robot)")
    assert look_at_estop(bus).pressed
    rig.bed.key(PAD, "BTN_MODE", 0)
    rig.let_go()
    rig.says("ready: hold the dead-man", times=2)
    rig.bed.key(PAD, "BTN_START", 1)
    rig.says("emergency stop released")
    rig.bed.key(PAD, "BTN_START", 0)
    assert not look_at_estop(bus).pressed
    rig.bed.key(PAD, "BTN_TL", 1)
    rig.says("you drive", times=2)
    rig.drives(0.0)
    rig.bed.axis(PAD, "ABS_Y", 0)
    rig.drives(0.5)


def test_a_pad_that_is_switched_on_later_is_found(bed, start):
    rig = start()
    rig.says("no pad is there")
    bed.plug(PAD)
    rig.says(f"pad: {SONY} (/dev/input/event5)")
    rig.says("nobody will notice if it freezes")
    rig.says("ready: hold the dead-man")


def test_a_pad_that_may_not_be_opened_is_named_with_the_remedy(bed, start):
    bed.plug(PAD)
    bed.forbid(PAD, 0)
    rig = start(prefix=AS_A_USER)
    assert rig.process.wait(20.0) == 2
    what, remedy = rig.process.output().splitlines()[-2:]
    assert what == f"lira joystick: no permission to open {SONY} (/dev/input/event5)"
    assert "lira joystick --rules" in remedy


def test_permission_that_is_lost_while_it_drives_stops_the_robot_and_comes_back_by_itself(bed, start):
    bed.plug(MOTION, f"{SONY} Motion Sensors", motion=True)
    bed.plug(PAD)
    rig = start(prefix=AS_A_USER)
    rig.says("ready: hold the dead-man")
    rig.begin()
    bed.forbid(PAD, 0)
    rig.stands()
    rig.says(f"no permission to read {SONY} (/dev/input/event5) any more")
    rig.zeros_then_silence(released=False)
    rig.says(f"no permission to open {SONY}")
    bed.forbid(PAD, 0o600)
    rig.says(f"pad: {SONY}", times=2)
    rig.let_go()
    rig.says("ready: hold the dead-man", times=2)
    rig.begin_again()


def test_what_was_learned_about_the_pad_outlives_the_bridge(rig, bed, start, tmp_path):
    rig.process.signal(signal.SIGKILL)
    rig.process.wait(10.0)
    (pad, traits), *others = json.loads((tmp_path / "state" / "lira" / "pads.json").read_text()).items()
    assert not others
    assert pad == "054c/0268/00:11:22:33:44:55"
    assert 0.1 <= traits["timeout_s"] <= 0.4
    start().says("ready: hold the dead-man")


def test_buttons_ask_while_the_hand_is_off_and_say_that_nobody_answers(rig):
    for button, request in (("BTN_WEST", Request.PAUSE), ("BTN_NORTH", Request.SAVE), ("BTN_EAST", Request.RESET)):
        rig.bed.key(PAD, button, 1)
        wait_for(lambda request=request: rig.asked.last() == OperatorRequest(request), rig.process.output)
        rig.bed.key(PAD, button, 0)
    assert len(rig.asked.all()) == 3
    rig.says("nobody answers to 'reset': does lira fusion run?")
    assert rig.applied.last().source is Source.NONE


def test_a_device_that_is_no_pad_is_refused(bed, start):
    bed.plug(MOTION, f"{SONY} Motion Sensors", motion=True)
    rig = start("--device", "/dev/input/event4")
    assert rig.process.wait(20.0) == 2
    assert "event4) is no gamepad" in rig.process.output()


def test_learn_asks_and_writes_a_file_that_loads(bed, start, tmp_path):
    bed.plug(3, "A touchpad", keys=[272, *range(320, 336)], axes=(0, 1, 53, 54), uniq="")
    bed.plug(PAD, axes=(*PAD_AXES, *HAT))
    path, link = tmp_path / "mine.toml", tmp_path / "by-id"
    link.symlink_to("/dev/input/event5")
    rig = start("--learn", str(path), "--device", str(link))
    for words, name, value, rest in (
        ("FORWARD", "ABS_Y", 0, 128), ("LEFT", "ABS_RX", 0, 128), ("DEAD-MAN", "BTN_TR", 1, 0),
        ("TURBO", "BTN_TL", 1, 0), ("EMERGENCY STOP", "BTN_EAST", 1, 0), ("RELEASES", "BTN_NORTH", 1, 0),
        ("PAUSES", "BTN_WEST", 1, 0), ("SAVES", "BTN_SELECT", 1, 0), ("EPISODE", "BTN_START", 1, 0),
        ("PROOF", "BTN_SOUTH", 1, 0), ("UNDOES", "BTN_THUMBL", 1, 0),
        ("EXPERT 1", "ABS_HAT0Y", -1, 0), ("EXPERT 2", "ABS_Z", 255, 0), ("EXPERT 3", "ABS_HAT0Y", 1, 0),
    ):  # fmt: skip
        rig.says(f"{words}")
        send = bed.axis if name.startswith("ABS") else bed.key
        send(PAD, name, value)
        rig.says(f"{words}", 1)
        rig.says(f"... {name}", 2 if words == "EXPERT 3" else 1)
        send(PAD, name, rest)
    assert rig.process.wait(30.0) == 0  # the fourth expert goes unanswered
    from lira.tools.joystick.pads.mapping import load_mapping

    mapping = load_mapping(str(path))
    assert (mapping.forward.axis, mapping.forward.inverted, mapping.turn.axis) == ("ABS_Y", True, "ABS_RX")
    assert (mapping.dead_man, mapping.turbo, mapping.estop, mapping.release) == (
        "BTN_TR", "BTN_TL", ("BTN_EAST",), "BTN_NORTH",
    )  # fmt: skip
    assert (mapping.pause, mapping.save, mapping.reset, mapping.prove, mapping.undo, mapping.experts) == (
        "BTN_WEST", "BTN_SELECT", "BTN_START", "BTN_SOUTH", "BTN_THUMBL", ("ABS_HAT0Y-", "ABS_Z+", "ABS_HAT0Y+"),
    )  # fmt: skip


def test_a_touchpad_is_not_learned(bed, start, tmp_path):
    bed.plug(3, "A touchpad", keys=[272, *range(320, 336)], axes=(0, 1, 53, 54), uniq="")
    for words, complaint in ((), "no pad is there"), (("--device", "/dev/input/event3"), "is no gamepad"):
        rig = start("--learn", str(tmp_path / "mine.toml"), *words)
        assert rig.process.wait(20.0) == 2
        assert complaint in rig.process.output()


DS4, DS4_KEYS = (0x054C, 0x09CC), [304, 305, *range(307, 309), *range(310, 319)]


def test_a_hat_asks_for_experts_and_the_layout_is_that_of_the_pad(bed, start):
    bed.plug(PAD, "Wireless Controller", keys=DS4_KEYS, axes=(*PAD_AXES, *HAT), ids=DS4)
    rig = start()
    rig.says("layout DualShock 4, DualSense")
    rig.says("ready: hold the dead-man")
    rig.begin()  # before it has heard the robot it asks nothing
    bed.axis(PAD, "ABS_HAT0X", 1)
    wait_for(lambda: rig.asked.last() == OperatorRequest(Request.HANDOVER, "expert 2"), rig.process.output)


def test_a_pad_that_comes_back_by_cable_under_another_name_is_the_same(bed, start):
    bed.plug(PAD, "Wireless Controller", keys=DS4_KEYS, axes=(*PAD_AXES, *HAT), ids=DS4)
    rig = start()
    rig.says("ready: hold the dead-man")
    bed.unplug(PAD)
    rig.says("event5")
    name = "Sony Interactive Entertainment Wireless Controller"
    bed.plug(9, name, keys=DS4_KEYS, axes=(*PAD_AXES, *HAT), ids=DS4)
    rig.says(f"pad: {name} (/dev/input/event9)")
    rig.says("ready: hold the dead-man", times=2)


def test_motion_sensors_that_may_not_be_read_are_told_and_the_pad_drives(bed, start):
    bed.plug(MOTION, f"{SONY} Motion Sensors", motion=True)
    bed.plug(PAD)
    bed.forbid(MOTION, 0)
    rig = start(prefix=AS_A_USER)
    rig.says(f"no permission to open {SONY} Motion Sensors (/dev/input/event4)")
    rig.says("Nobody will notice if it freezes")
    rig.says("ready: hold the dead-man")
    rig.begin()


def test_a_pad_whose_buttons_nobody_knows_is_named_and_asked_about(bed, start):
    bed.plug(PAD, "PDP Pad", keys=range(304, 317), axes=(0, 1, 2, 5, *HAT), ids=(0x0E6F, 0x0185))
    rig = start()
    rig.says("PDP Pad (/dev/input/event5) numbers its buttons as its maker likes")
    rig.says("lira joystick --learn my-pad.toml --device /dev/input/event5")
    time.sleep(0.5)
    assert "ready" not in rig.process.output()


def test_a_pad_that_is_not_at_rest_says_which_axis_reads_what(bed, start):
    bed.plug(PAD)
    bed.axis(PAD, "ABS_Y", 150)
    rig = start()
    rig.says("not at rest: ABS_Y reads +0.18 (dead zone 0.12)")
    bed.axis(PAD, "ABS_Y", 151)
    time.sleep(1.2)
    assert rig.process.output().count("not at rest") == 1
    bed.axis(PAD, "ABS_Y", 128)
    rig.says("ready: hold the dead-man")
