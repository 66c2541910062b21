"""A robot of ours offered to a graph of rmw_zenoh: seen, heard and driven there, and judged as on the bus."""

import random
import re
import struct
import threading
import time
from contextlib import contextmanager

import pytest
import zenoh
from trigger import REQUEST, read_answer
from wiring import joined, new_endpoint, real_time_null, served, wait_for
from zenoh import ext

from lira.hal.bus.topics import APPLIED, CAMERA, COMMANDS, FROM_OPERATORS, SCAN
from lira.hal.errors import ConfigError
from lira.hal.messages import STOP, Reason, Source, Twist
from lira.hal.messages.motion import TwistStamped
from lira.hal.messages.ros.codec import encode
from lira.hal.rmw.attachment import RmwAttachment
from lira.hal.rmw.hashes import type_hash
from lira.hal.rmw.names import RmwKey
from lira.hal.rmw.services import TRIGGER
from lira.hal.rmw.tokens import Kind
from lira.hal.ros_graph.look import look
from lira.hal.ros_graph.node import RosNode
from lira.hal.ros_graph.session import open_ros_session
from lira.tools.ros2.graph import Graph, graph_of
from lira.tools.ros2.offer import Offer
from lira.tools.ros2.telemetry import said_by

GO = Twist(0.2, 0.1)


def key(topic, ros_type):
    return str(RmwKey(0, topic, ros_type, type_hash(ros_type)))


class RosPublisher:
    """A publisher of velocities, as a node of rmw_zenoh has one."""

    def __init__(self, session, *, stamped=False, topic="cmd_vel", gid=bytes(range(16))):
        self.session, self.stamped, self.gid, self.number = session, stamped, gid, 0
        self.key = key(topic, f"geometry_msgs/msg/{'TwistStamped' if stamped else 'Twist'}")

    def put(self, twist, *, late_s=0.0, stamp_s=None, attachment=True):
        self.number += 1
        now_s = time.time()
        message = TwistStamped(now_s if stamp_s is None else stamp_s, twist) if self.stamped else twist
        beside = RmwAttachment(self.number, round((now_s - late_s) * 1e9), self.gid).to_bytes()
        self.session.put(self.key, encode(message), attachment=beside if attachment else None)


class Offered:
    """A robot in a graph, a node there, and what the robot applied."""

    def __init__(self, robot, bus, session, graph_at):
        self.robot, self.session, self.graph_at = robot, session, graph_at
        self._applied = bus.reader(APPLIED, 64)
        self.applied = None

    def drive(self, publisher, twist, wanted, timeout_s=5.0, **how):
        """Command at 50 Hz until what was applied is as wanted."""

        def is_so():
            publisher.put(twist, **how)
            time.sleep(0.015)
            for received in self._applied.poll():
                self.applied = received.message
            return self.applied is not None and wanted(self.applied)

        wait_for(is_so, timeout_s)
        return self.applied

    def get_going(self, publisher):
        self.drive(publisher, STOP, lambda applied: applied.reason is Reason.OK)
        return self.drive(publisher, GO, lambda applied: applied.twist == GO)


@contextmanager
def offered():
    graph_at, stop = new_endpoint(), threading.Event()
    with served(real_time_null(), arena_info=b"{}") as robot, joined(robot) as bus, joined(robot) as watcher:
        node = RosNode(robot.name, listen=graph_at)
        offer = Offer(bus, node)
        thread = threading.Thread(target=offer.run, args=(stop,))
        thread.start()
        session = open_ros_session(connect=graph_at)
        try:
            yield Offered(robot, watcher, session, graph_at)
        finally:
            stop.set()
            thread.join(10.0)
            assert not thread.is_alive()
            session.close()
            assert node.close()


def test_everything_that_it_says_is_listed_with_its_type_and_services():
    with offered() as there:
        seen = look(there.graph_at)
        listed = {(each.kind, each.name): each for each in seen.endpoints}
        profile = there.robot.inner.profile
        for topic in said_by(profile, arena=True):
            endpoint = listed[Kind.PUBLISHER, f"/{topic.key}"]
            assert (endpoint.ros_type, endpoint.type_hash) == (topic.ros_type, type_hash(topic.ros_type))
            assert endpoint.qos.latched == topic.qos.latched
        heard = [each.ros_type for (kind, name), each in listed.items() if kind is Kind.SUBSCRIPTION]
        assert heard
        both = {each.ros_type for each in seen.endpoints if each.name == "/cmd_vel"}
        assert both == {"geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"}
        services = {name for kind, name in listed if kind is Kind.SERVICE}
        assert services == {"/estop/press", "/estop/release", "/estop/look", "/sim/reset"}


def test_what_it_says_is_the_message_of_the_bus_in_unix_time_with_an_attachment():
    with offered() as there:
        came = []
        hears = there.session.declare_subscriber(key("odom", "nav_msgs/msg/Odometry"), came.append)
        wait_for(lambda: len(came) > 3)
        sec, nanosec = struct.unpack_from("<iI", bytes(came[-1].payload), 4)
        assert abs(time.time() - sec - nanosec / 1e9) < 2.0
        numbers = []
        for sample in came:
            number, sent_ns, count = struct.unpack_from("<qqB", bytes(sample.attachment))
            assert (count, len(bytes(sample.attachment))) == (16, 33)
            assert abs(time.time_ns() - sent_ns) < 5e9
            numbers.append(number)
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
        del hears


def test_what_nobody_in_the_graph_listens_to_is_not_fetched_from_the_robot():
    with offered() as there:
        scans = there.robot._bus.publisher(SCAN)
        wait_for(lambda: not scans.matching)
        hears = there.session.declare_subscriber(key("scan", "sensor_msgs/msg/LaserScan"), lambda _: None)
        wait_for(lambda: scans.matching)
        hears.undeclare()
        wait_for(lambda: not scans.matching)


def test_its_model_reaches_whoever_subscribes_later():
    with offered() as there:
        came = []
        late = ext.declare_advanced_subscriber(
            there.session,
            key("robot_description", "std_msgs/msg/String"),
            came.append,
            history=ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
        )
        wait_for(lambda: came)
        assert b"<robot" in bytes(came[0].payload)
        del late


@pytest.mark.parametrize("stamped", [False, True])
def test_it_is_driven_and_stops_when_nothing_comes(stamped):
    with offered() as there:
        publisher = RosPublisher(there.session, stamped=stamped)
        applied = there.get_going(publisher)
        assert applied.source is Source.POLICY
        silent_s = time.monotonic()
        wait_for(lambda: there.robot.governed.tick().twist == STOP, 1.0)
        assert time.monotonic() - silent_s < 0.6


def test_motion_without_a_neutral_command_does_not_set_it_off(capsys):
    with offered() as there:
        publisher = RosPublisher(there.session)
        there.drive(publisher, GO, lambda applied: applied.reason is Reason.NEUTRAL_FIRST)
        told = []

        def is_told():
            publisher.put(GO)
            time.sleep(0.03)
            told.append(capsys.readouterr().err)
            return "publish one first" in "".join(told)

        wait_for(is_told)


def test_a_command_that_a_link_held_back_or_that_was_decided_long_ago_drives_nothing():
    with offered() as there:
        publisher = RosPublisher(there.session, stamped=True)
        there.get_going(publisher)
        for how in ({"late_s": 0.6, "stamp_s": 0.0}, {"stamp_s": time.time() - 5.0}):
            there.drive(publisher, GO, lambda applied: applied.twist == STOP, **how)
            assert there.applied.reason in (Reason.REFUSED, Reason.STALE)
            there.get_going(publisher)
        assert there.robot.governed.refused.keys() <= {"out of order", "late"}  # decided before what is known


def test_two_in_the_graph_are_two_commanders_and_the_first_keeps_the_lease():
    with offered() as there:
        first, second = (RosPublisher(there.session, gid=bytes([number] * 16)) for number in (1, 2))
        there.get_going(first)
        for _ in range(20):
            first.put(GO)
            second.put(Twist(-0.2, 0.0))
            time.sleep(0.02)
        assert there.robot.governed.refused["another commander"] > 0
        assert there.drive(first, GO, lambda applied: applied.twist == GO)


def test_what_has_no_attachment_or_is_garbage_drives_nothing_and_harms_nobody(capsys):
    with offered() as there:
        publisher = RosPublisher(there.session)
        there.get_going(publisher)
        for payload, attachment in [
            (encode(GO), None),
            (encode(GO), b"x" * 33),
            (b"", b"\0" * 33),
            (b"\0\1\0\0" + b"\xff" * 48, RmwAttachment(1, 0, bytes(16)).to_bytes()),
            (b"x" * 5000, b"y" * 5000),
        ]:
            for topic in ("cmd_vel", "cmd_vel/teleop"):
                there.session.put(key(topic, "geometry_msgs/msg/Twist"), payload, attachment=attachment)
            there.session.put(key("estop", "std_msgs/msg/Bool"), payload, attachment=attachment)
        there.drive(publisher, GO, lambda applied: applied.twist == GO)
        assert there.robot.failure is None
        assert "no sender" in capsys.readouterr().err


def test_no_noise_on_any_of_its_keys_ends_it_or_sets_anything_off():
    with offered() as there:
        publisher = RosPublisher(there.session)
        there.get_going(publisher)
        noise = random.Random(7)
        keys = [each.key for each in look(there.graph_at).endpoints]
        for _ in range(400):
            payload, beside = (noise.randbytes(noise.choice((0, 4, 33, 60, 300))) for _ in range(2))
            if noise.random() < 0.5:
                beside = RmwAttachment(noise.getrandbits(62), noise.getrandbits(62), noise.randbytes(16)).to_bytes()
            there.session.put(noise.choice(keys), payload, attachment=beside)
            there.session.get(noise.choice(keys), payload=payload, attachment=beside, timeout=0.1)
        assert there.robot.failure is None
        ask(there, "estop/release")  # noise may well have pressed it
        there.get_going(publisher)


def test_every_token_of_it_is_whole_for_a_strict_reader():
    with offered() as there:
        tokens = [str(reply.ok.key_expr).split("/") for reply in there.session.liveliness().get("@ros2_lv/**")]
        assert len(tokens) >= 20
        for parts in tokens:
            assert len(parts) == (9 if parts[5] == "NN" else 13)
            assert all(parts)
            assert all(part.isascii() for part in parts)
            if parts[5] != "NN":
                assert re.fullmatch(r"RIHS01_[0-9a-f]{64}", parts[11])
                assert re.fullmatch(r"[0-9]*:[0-9]*:[0-9]*,[0-9]*:,:,:,,", parts[12])


def test_a_hand_in_the_graph_goes_before_policy_and_gives_back():
    with offered() as there:
        policy = RosPublisher(there.session)
        hand = RosPublisher(there.session, topic="cmd_vel/teleop", gid=bytes(16))
        there.get_going(policy)

        def both(twist):
            def put():
                policy.put(GO)
                hand.put(twist)
                time.sleep(0.015)
                for received in there._applied.poll():
                    there.applied = received.message

            return put

        turn = Twist(0.0, 0.3)
        wait_for(lambda: both(turn)() or there.applied.source is Source.TELEOP)
        wait_for(lambda: both(STOP)() or there.applied.source is Source.POLICY)


def ask(there, service):
    handler = there.session.get(
        key(service, TRIGGER),
        zenoh.handlers.FifoChannel(4),
        payload=REQUEST,
        attachment=RmwAttachment(1, time.time_ns(), bytes(range(16))).to_bytes(),
        target=zenoh.QueryTarget.ALL_COMPLETE,
        timeout=5.0,
    )
    (reply,) = list(handler)
    return read_answer(bytes(reply.ok.payload))


def test_the_emergency_stop_is_pressed_and_released_by_services_and_pressed_by_the_topic():
    with offered() as there:
        publisher = RosPublisher(there.session)
        there.get_going(publisher)
        assert ask(there, "estop/press") == (True, "emergency")
        there.drive(publisher, GO, lambda applied: applied.reason is Reason.ESTOP)
        assert ask(there, "estop/look") == (True, "emergency")
        assert ask(there, "estop/release")[0]
        there.get_going(publisher)
        data = b"\0\1\0\0\1"
        there.session.put(key("estop", "std_msgs/msg/Bool"), data, attachment=RmwAttachment(1, 0, bytes(16)).to_bytes())
        there.drive(publisher, GO, lambda applied: applied.reason is Reason.ESTOP)


@pytest.mark.parametrize("expression", ["**", "0/**", "0/estop/**", "0/*/release/**", "0/sim/reset/*/*"])
def test_who_asks_all_keys_at_once_releases_and_resets_nothing(expression):
    with offered() as there:
        assert ask(there, "estop/press") == (True, "emergency")
        resets = []
        there.robot.inner.reset = resets.append
        replies = there.session.get(
            expression, zenoh.handlers.FifoChannel(64), payload=REQUEST, target=zenoh.QueryTarget.ALL, timeout=1.0
        )
        assert [reply for reply in replies if reply.ok is not None and b"emergency" in bytes(reply.ok.payload)] == []
        assert ask(there, "estop/look")[1] == "emergency"
        assert resets == []


def test_a_twin_starts_afresh_by_a_service():
    with offered() as there:
        resets = []
        there.robot.inner.reset = resets.append
        assert ask(there, "sim/reset")[0]
        assert resets


def test_what_is_offered_is_what_it_has_and_says_itself():
    profile = real_time_null().profile
    keys = {topic.key for topic in said_by(profile, arena=False)}
    assert not keys & {topic.key for topic in COMMANDS}
    assert keys & {topic.key for topic in FROM_OPERATORS} == {"diagnostics"}
    assert {"scan", "odom", "tf", "tf_static", "robot_description", CAMERA.key, "cmd_vel/applied"} <= keys
    assert "sim/state" not in keys
    assert "sim/state" in {topic.key for topic in said_by(profile, arena=True)}


def test_the_words_for_a_graph():
    assert graph_of("", 0, "/") == Graph()
    assert graph_of("own:127.0.0.1:7500", 3, "/a").told()[1].endswith("""'connect/endpoints=["tcp/127.0.0.1:7500"]'""")
    with pytest.raises(ConfigError, match="anybody in the ROS 2 graph of rosbot:7447"):
        graph_of("rosbot:7447", 0, "/")
    router = graph_of("rosbot:7447", 0, "/", insecure=True)
    assert not router.own
    assert "router at rosbot:7447" in router.told()[0]
    with pytest.raises(ConfigError, match="no address"):
        graph_of("own:", 0, "/") and graph_of("nowhere", 0, "/")
