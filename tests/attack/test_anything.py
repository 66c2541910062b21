"""Arbitrary messages, deletes and queries at a live robot of each kind: it lives, stands, and drives who may drive."""

import json
import struct
import time
from contextlib import contextmanager

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from scene import Scene, kill
from zenoh.handlers import RingChannel

from lira.hal.bus.attachment import MAGIC
from lira.hal.bus.bus import Bus
from lira.hal.bus.services import ask_info, look_at_estop, release_estop
from lira.hal.bus.topics import CMD_VEL, ESTOP_LOOK, ESTOP_PRESS, ESTOP_RELEASE, INFO, RESET, TOPICS
from lira.hal.client.connect import open_remote
from lira.hal.messages import STOP, Applied, Bool, Clock, Command, LaserScan, Odometry, Twist
from lira.hal.messages.ros.codec import encode

EXAMPLES = 15
MORE_MB = 80

WORDS = st.integers(0, 2**64 - 1) | st.sampled_from([0, 1, 2**63 - 1, 2**63, 2**64 - 1])
SIGNED = st.integers(-(2**63), 2**63 - 1) | st.sampled_from([-1, 0, -(2**63), 2**63 - 1])
OURS = st.builds(
    lambda epoch, seq, time_ns, answers, flags: struct.pack("<4sQQqqB", MAGIC, epoch, seq, time_ns, answers, flags),
    *[WORDS, WORDS, SIGNED, SIGNED, st.integers(0, 255)],
)
# In the middle of what the robot's clock may show, so that some of it is obeyed: a zero, with the oddest of counts.
FRESH = st.builds(lambda seq: struct.pack("<4sQQqqB", MAGIC, 7, seq, time.monotonic_ns(), -1, 0), WORDS)
ATTACHMENTS = st.none() | OURS | FRESH | st.binary(max_size=64)

NUMBERS = st.floats() | st.sampled_from([1e308, -1e308, 1e9, 5e-324])
SINGLES = st.floats(width=32)
SCANS = st.builds(
    lambda start, step, beams: encode(LaserScan(1.0, start, step, 0.1, 4.0, np.zeros(beams, np.float32))),
    *[SINGLES, SINGLES, st.integers(0, 3000)],
)
MESSAGES = st.one_of(
    st.sampled_from([encode(STOP), encode(Bool(False)), encode(Applied(STOP, 1.0)), encode(Clock(1.0))]),
    st.builds(lambda a, b: encode(Odometry(1.0, a, b, 0.0, a, b)), NUMBERS, NUMBERS),
    SCANS,
)
SPOILT = st.builds(
    lambda payload, at, byte: payload[: at % (len(payload) + 1)] + byte + payload[at % (len(payload) + 1) + 1 :],
    *[MESSAGES, st.integers(0, 4000), st.binary(max_size=8)],
)
ZEROS = st.integers(0, 10**6)  # so many of them
PAYLOADS = MESSAGES | SPOILT | ZEROS | st.binary(max_size=200)
# Whether the emergency stop holds afterwards is not what is asked here, and motion would be somebody's command.
KEYS = st.sampled_from([*(topic.key for topic in TOPICS), "nothing", "cmd_vel/a/b"])
EPISODES = st.fixed_dictionaries(
    {"layout": SIGNED, "start_m": NUMBERS, "lateral_m": NUMBERS, "yaw_rad": NUMBERS, "began_m": st.none() | NUMBERS}
).map(json.dumps)
ASKED = [INFO, RESET, ESTOP_PRESS, ESTOP_RELEASE, ESTOP_LOOK, "**"]
QUESTIONS = st.binary(max_size=50) | EPISODES.map(str.encode) | st.sampled_from([b"[" * 5000, b'{"start_m":1e308}'])


class Thrown(list):
    """Actions that do not fill the page when they kill a robot."""

    def __repr__(self):
        return f"{super().__repr__():.3000}"


ACTIONS = st.lists(
    st.one_of(
        st.tuples(st.just("put"), st.sampled_from(["cmd_vel", "cmd_vel/teleop"]), st.just(encode(STOP)), FRESH),
        st.tuples(st.just("put"), KEYS, PAYLOADS, ATTACHMENTS),
        st.tuples(st.just("delete"), KEYS, st.none(), ATTACHMENTS),
        st.tuples(st.just("ask"), st.sampled_from(ASKED), QUESTIONS, ATTACHMENTS),
    ),
    min_size=10,
    max_size=40,
).map(Thrown)


def act(session, prefix, actions):
    for what, key, payload, attachment in actions:
        if what == "put":
            data = b"\0\1\0\0" + bytes(payload) if isinstance(payload, int) else payload
            session.put(f"{prefix}{key}", data, attachment=attachment)
        elif what == "delete":
            session.delete(f"{prefix}{key}", attachment=attachment)
        else:
            session.get(f"{prefix}{key}", RingChannel(1), payload=payload, attachment=attachment, timeout=1.0)


@contextmanager
def joined(scene):
    bus = Bus(scene.name, connect=scene.endpoint)
    publisher = bus.publisher(CMD_VEL)
    assert scene.wait(lambda: publisher.matching, 5.0)
    yield bus
    assert bus.close()


def attack(scene, session, prefix):
    """Throw many lists of actions at it; it answers in between."""

    # A robot that is dead cannot be asked again, so what killed it is not made smaller.
    @settings(max_examples=EXAMPLES, deadline=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck))
    @given(ACTIONS)
    def throw(actions):
        act(session, prefix, actions)
        assert scene.robot.status() is None, scene.robot.output()

    throw()


@pytest.mark.parametrize("kind", ["null", "twin", "ros2"])
def test_whatever_is_sent_it_lives_stands_and_drives_who_may(kind, tmp_path):
    with Scene(kind, tmp_path) as scene, joined(scene) as bus:
        driver, _ = scene.driver()
        assert scene.wait(scene.moves, 10.0)
        kill(driver)
        before_mb = scene.memory_mb()
        attack(scene, bus._session, f"{scene.name}/")
        assert ask_info(bus, 5.0).profile.name
        assert scene.wait(lambda: not scene.moves(), 2.0)
        began = len(scene.orders())
        time.sleep(1.0)
        assert {linear for _, linear in scene.orders()[began:]} == {0.0}
        look_at_estop(bus)  # then all that was pressed before has been served
        release_estop(bus)
        scene.driver()
        assert scene.wait(scene.moves, 10.0)
        assert scene.memory_mb() - before_mb < MORE_MB


def test_whatever_a_robot_behind_a_bridge_sends_it_lives_and_stands(tmp_path):
    with Scene("ros2", tmp_path) as scene:
        driver, _ = scene.driver()
        assert scene.wait(scene.moves, 10.0)
        far = Bus("far", connect=f"127.0.0.1:{scene.far_port}", prefix="")
        attack(scene, far._session, "")
        assert far.close()
        assert scene.wait(scene.moves, 10.0)
        kill(driver)
        assert scene.wait(lambda: not scene.moves(), 2.0)


def test_whatever_is_sent_lockstep_goes_on(tmp_path):
    with Scene("lockstep", tmp_path) as scene, joined(scene) as bus:
        attack(scene, bus._session, f"{scene.name}/")
        look_at_estop(bus)  # then all that was pressed before has been served
        release_estop(bus)
        robot = open_remote(bus)
        for twist in (STOP, STOP, Twist(0.15, 0.0), Twist(0.15, 0.0)):
            applied = robot.drive(Command(twist, robot.now(), answers=robot.read().seq))
            robot.wait(robot.now() + robot.profile.period_s)
        assert applied.twist == Twist(0.15, 0.0)
        robot.close()


def test_one_sample_with_the_largest_count_ends_nothing(tmp_path):
    with Scene("null", tmp_path) as scene, joined(scene) as bus:
        for seq in (2**63, 2**64 - 1, 2**63 - 1):
            attachment = struct.pack("<4sQQqqB", MAGIC, 5, seq, time.monotonic_ns(), -1, 0)
            bus._session.put(f"{scene.name}/cmd_vel", encode(STOP), attachment=attachment)
            time.sleep(0.2)
        scene.driver()
        assert scene.wait(scene.moves, 10.0)
