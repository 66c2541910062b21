import ctypes
import os

import pytest
from fresh import lira, python

from lira.hal.errors import DeviceError
from lira.tools.joystick.axes import AxisRange, PadEvent, PadState
from lira.tools.joystick.device.event_device import EVENT, EventDevice
from lira.tools.joystick.device.finder import choose
from lira.tools.joystick.device.rumble_motor import Motor
from lira.tools.joystick.pad_detect import moved_axis, pressed_button
from lira.tools.joystick.pads.mapping import load_mapping
from lira.tools.joystick.pads.nodes import Node, is_any_pad, motion_of, parse_bitmap, read_nodes

PS3 = load_mapping("ps3")
KEYS = frozenset({*range(304, 319), *range(544, 548)} - {306, 309})


def node(number, name="pad", *, buttons=KEYS, axes=frozenset(range(6)), uniq="1", motion=False):
    return Node(f"/dev/input/event{number}", name, "054c", "0268", uniq, buttons, axes, motion)


MOTION = node(4, "pad Motion Sensors", buttons=frozenset(), motion=True)
KEYBOARD = node(2, "keyboard", buttons=frozenset(range(1, 120)), axes=frozenset())


def test_bitmaps_are_read_highest_word_first():
    assert parse_bitmap("7fdb000000000000 0 0 0 0", 64) == {
        304,
        305,
        307,
        308,
        310,
        311,
        312,
        313,
        314,
        315,
        316,
        317,
        318,
    }
    assert parse_bitmap("3f") == {0, 1, 2, 3, 4, 5}
    assert parse_bitmap("1 0", 32) == {32}
    assert parse_bitmap("0") == frozenset()


def test_a_pad_is_known_by_its_controls_not_by_its_name():
    nodes = [KEYBOARD, MOTION, node(5, "anything"), node(6, "pad")]
    assert choose(nodes, PS3)[0].path == "/dev/input/event5"
    assert choose(nodes)[1].name == "PS3"
    assert choose([node(7, axes=frozenset([0]))], PS3) is None
    assert choose([KEYBOARD, MOTION], PS3) is choose([KEYBOARD, MOTION]) is None
    assert [is_any_pad(n) for n in nodes] == [False, False, True, True]


def test_motion_sensors_belong_to_the_pad_with_the_same_address():
    other = node(3, "pad Motion Sensors", buttons=frozenset(), motion=True, uniq="2")
    assert motion_of(node(5), [other, MOTION]) is MOTION
    assert motion_of(node(5), [other]) is None


def test_a_given_device_is_taken_through_a_link_and_refused_if_it_is_no_pad(tmp_path):
    link = tmp_path / "by-id"
    link.symlink_to("/dev/input/event6")
    assert choose([node(5), node(6)], PS3, str(link))[0].path == "/dev/input/event6"
    assert choose([node(5)], PS3, "/dev/input/event9") is None
    for given in (PS3, None):
        with pytest.raises(DeviceError, match="pad Motion Sensors"):
            choose([MOTION], given, MOTION.path)
    (tmp_path / "js0").touch()
    with pytest.raises(DeviceError, match="is no event device"):
        choose([node(5)], None, str(tmp_path / "js0"))


def test_a_node_that_goes_away_while_it_is_read_is_left_out(tmp_path):
    (tmp_path / "event3" / "device").mkdir(parents=True)
    assert read_nodes(tmp_path) == []


def test_learning_takes_the_control_that_moved_and_its_direction():
    ranges = dict.fromkeys(range(6), AxisRange())
    rest = PadState(ranges, {0: 128, 1: 130, 2: 0}, frozenset([311]))
    up = PadState(ranges, {0: 140, 1: 0, 2: 0}, frozenset([311, 310]))
    axis = moved_axis(rest, up)
    assert (axis.axis, axis.inverted) == ("ABS_Y", True)
    trigger = PadState(ranges, {0: 128, 1: 130, 2: 255}, frozenset([311]))
    assert pressed_button(rest, trigger) == "ABS_Z+"
    assert pressed_button(rest, trigger, frozenset(["ABS_Z"])) is None
    assert pressed_button(rest, up, frozenset(["ABS_Y"])) == "BTN_TL"
    assert moved_axis(rest, PadState(ranges, {0: 160, 1: 130, 2: 0})) is None
    trigger = moved_axis(rest, PadState(ranges, {0: 128, 1: 130, 2: 255}))
    assert (trigger.axis, trigger.inverted) == ("ABS_Z", False)
    assert pressed_button(rest, up) == "BTN_TL"
    assert pressed_button(rest, rest) is None


class Motors:
    """A device that counts effects as the kernel does: stopping or erasing what is not there is an error."""

    def __init__(self, *, gone=False):
        self.effects, self.running, self.gone, self.levels = set(), set(), gone, []

    def upload_rumble(self, level, longest_ms):
        if self.gone:
            raise OSError(19, "No such device")
        assert 0 < longest_ms <= 1000
        self.levels.append(level)
        number = len(self.levels)
        self.effects.add(number)
        return number

    def play(self, number, on):
        assert number in self.effects
        (self.running.add if on else self.running.discard)(number)

    def erase(self, number):
        self.effects.remove(number)


def test_motors_stop_for_certain_and_leave_no_effect_behind():
    device = Motors()
    motor = Motor(device)
    for strength in (1.0, 1.0, 0.5, 0.0, 0.0):
        motor.set(strength)
        assert bool(device.running) == (strength > 0.0)
    assert device.levels == [0xFFFF, 0x8000]
    assert device.effects == set()


def test_a_pad_that_goes_while_it_rumbles_raises_nothing():
    Motor(Motors(gone=True)).set(1.0)


@pytest.mark.parametrize("verb", ["joystick", "console"])
def test_help_needs_neither_pygame_nor_evdev(verb):
    done = lira(verb, "--help", block=["pygame", "evdev", "zenoh", "cv2"])
    assert done.returncode == 0, done.stderr
    assert "examples:" in done.stdout


@pytest.mark.parametrize(("verb", "package", "extra"), [("console", "pygame", "console")])
def test_a_missing_package_is_named_before_a_robot_is_looked_for(verb, package, extra):
    done = lira(verb, block=[package])
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        f"lira {verb}: {package} is not installed",
        f"  Install it with: pip install 'lira-rosbot[{extra}]'",
    ]


def test_the_bridge_needs_no_package():
    code = "import sys; sys.modules.update(pygame=None, evdev=None); "
    code += "from lira.tools.joystick import bridge, client, pad_wizard\nfrom lira.tools.joystick.device import pad"
    assert python(code).returncode == 0


def test_an_unknown_pad_is_refused_before_a_robot_is_looked_for():
    done = lira("joystick", "--pad", "nosuch")
    assert done.returncode == 2
    assert "unknown pad 'nosuch'" in done.stderr


class Replay(ctypes.Structure):
    _fields_ = (("length", ctypes.c_uint16), ("delay", ctypes.c_uint16))


class Periodic(ctypes.Structure):
    """The largest of the kernel's effects; it decides the size of all."""

    _fields_ = (
        ("waveform", ctypes.c_uint16), ("period", ctypes.c_uint16), ("magnitude", ctypes.c_int16),
        ("offset", ctypes.c_int16), ("phase", ctypes.c_uint16), ("envelope", ctypes.c_uint16 * 4),
        ("custom_len", ctypes.c_uint32), ("custom_data", ctypes.c_void_p),
    )  # fmt: skip


class RumbleEffect(ctypes.Structure):
    _fields_ = (("strong", ctypes.c_uint16), ("weak", ctypes.c_uint16))


class AnyEffect(ctypes.Union):
    _fields_ = (("periodic", Periodic), ("rumble", RumbleEffect))


class Effect(ctypes.Structure):
    """struct ff_effect of linux/input.h."""

    _fields_ = (
        ("type", ctypes.c_uint16), ("id", ctypes.c_int16), ("direction", ctypes.c_uint16),
        ("trigger", ctypes.c_uint16 * 2), ("replay", Replay), ("u", AnyEffect),
    )  # fmt: skip


def test_a_rumble_is_what_the_kernel_takes(tmp_path, monkeypatch):
    asked = []

    def ioctl(_, request, argument):
        asked.append((request, argument))
        if isinstance(argument, bytearray):
            effect = Effect.from_buffer(argument)
            assert (effect.type, effect.id, effect.replay.length, effect.replay.delay) == (0x50, -1, 800, 0)
            assert (effect.u.rumble.strong, effect.u.rumble.weak) == (40_000, 40_000)
            effect.id = 7
        return 0

    monkeypatch.setattr("lira.tools.joystick.device.event_device.fcntl.ioctl", ioctl)
    path = tmp_path / "event5"
    path.touch()
    device = EventDevice(str(path))
    assert device.upload_rumble(40_000, 800) == 7
    device.play(7, True)
    device.erase(7)
    device.close()
    (upload, effect), (erase, number) = asked
    assert (upload, len(effect)) == (1 << 30 | ctypes.sizeof(Effect) << 16 | 0x4580, ctypes.sizeof(Effect))
    assert (erase, number) == (0x40044581, 7)
    *_, kind, code, value = EVENT.unpack(path.read_bytes())
    assert (kind, code, value) == (0x15, 7, 1)


def test_a_device_that_may_only_be_read_is_opened_for_reading(tmp_path, monkeypatch):
    path = tmp_path / "event5"
    path.write_bytes(EVENT.pack(0, 0, 3, 1, 200) + b"half an event")
    real = os.open

    def refuse_writing(name, flags, *more):
        if flags & os.O_RDWR:
            raise PermissionError(13, "Permission denied")
        return real(name, flags, *more)

    monkeypatch.setattr("lira.tools.joystick.device.event_device.os.open", refuse_writing)
    device = EventDevice(str(path))
    assert device.read() == [PadEvent(3, 1, 200)]
    with pytest.raises(EOFError):
        device.read()
    device.close()
    device.close()
