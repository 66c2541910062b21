"""What ROS commands with: Twist or TwistStamped, judged by its stamp; and being told why it does not drive."""

import struct
import time

import pytest
import zenoh
from wiring import joined, new_endpoint, new_name, real_time_null, served, wait_for

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import APPLIED, CMD_VEL, DIAGNOSTICS
from lira.hal.messages import STOP, Reason, Twist, TwistStamped
from lira.hal.messages.ros.codec import encode
from lira.hal.server.command_watch import CommandWatch, Noted
from lira.hal.server.diagnostics import OK, WARN

GO = Twist(0.3, 0.0)


def twist_stamped(stamp_s, twist, frame=b"base_link"):
    """geometry_msgs/TwistStamped as CDR, written down without our codec."""
    sec, nanosec = divmod(round(stamp_s * 1e9), 10**9)
    data = struct.pack("<iII", sec, nanosec, len(frame) + 1) + frame + b"\0"
    data += b"\0" * (-len(data) % 8) + struct.pack("<6d", twist.linear_m_s, 0, 0, 0, 0, twist.angular_rad_s)
    return b"\x00\x01\x00\x00" + data


class Ros:
    """A peer as a bridge is one: a client with one link, without attachments. It repeats what `say` makes."""

    def __init__(self, robot):
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", f'["tcp/{robot.endpoint}"]')
        config.insert_json5("scouting/multicast/enabled", "false")
        config.insert_json5("timestamping/enabled", "true")
        self._session = zenoh.open(config)
        self._key = f"{robot.name}/cmd_vel"

    def put(self, payload):
        self._session.put(self._key, payload)

    def close(self):
        self._session.close()


@pytest.fixture
def scene():
    with served(real_time_null(), floor=True) as robot, joined(robot) as bus:
        ros = Ros(robot)
        yield robot, bus, ros
        ros.close()


def repeat(ros, say, wanted, timeout_s=5.0, pause_s=0.05):
    until_s = time.monotonic() + timeout_s
    while not wanted():
        assert time.monotonic() < until_s, "never happened"
        ros.put(say())
        time.sleep(pause_s)


def go(robot):
    """A peer of a busy machine may have paused, so that the robot waits for a zero again."""
    return GO if robot.governed.state == "armed" else STOP


@pytest.mark.parametrize("frame", [b"", b"base_link", b"a_frame_with_quite_a_long_name"])
def test_a_ros2_peer_drives_with_twist_stamped(scene, frame):
    robot, bus, ros = scene
    applied = bus.reader(APPLIED)

    def reason():
        newest = applied.newest()
        return None if newest is None else newest.message.reason

    repeat(ros, lambda: twist_stamped(time.time(), STOP, frame), lambda: reason() is Reason.OK)
    repeat(ros, lambda: twist_stamped(time.time(), go(robot), frame), lambda: robot.inner.state().linear_m_s == 0.3)
    wait_for(lambda: robot.inner.state().linear_m_s == 0.0, 1.0)


def test_a_stamp_of_zero_is_none_and_counts_by_its_arrival(scene):
    robot, _, ros = scene
    repeat(ros, lambda: twist_stamped(0.0, STOP), lambda: robot.governed.state == "armed")
    repeat(ros, lambda: twist_stamped(0.0, go(robot)), lambda: robot.inner.state().linear_m_s == 0.3)


def test_nav2_behind_a_mux_that_says_zeros_drives_and_a_silent_nav2_stands(scene):
    """As docs/howto/nav2.md has it: zeros without a stamp while nav2 has no goal, then its own, from one publisher."""
    robot, _, ros = scene
    repeat(ros, lambda: twist_stamped(0.0, STOP, b""), lambda: robot.governed.state == "armed")
    repeat(ros, lambda: twist_stamped(time.time() - 0.01, GO), lambda: robot.inner.state().linear_m_s == 0.3, 1.0)
    repeat(ros, lambda: twist_stamped(0.0, STOP, b""), lambda: robot.inner.state().linear_m_s == 0.0, 0.5)
    repeat(ros, lambda: twist_stamped(time.time() - 0.01, GO), lambda: robot.inner.state().linear_m_s == 0.3, 1.0)


@pytest.mark.parametrize(("lag_s", "refused", "way"), [(3.0, "late", "behind"), (-3.0, "from the future", "ahead of")])
def test_ros2_commands_with_the_stamps_of_another_clock_drive_nothing_and_that_is_told(scene, lag_s, refused, way):
    robot, bus, ros = scene
    told = bus.reader(DIAGNOSTICS)
    repeat(ros, lambda: encode(STOP), lambda: robot.governed.state == "armed")
    repeat(ros, lambda: twist_stamped(time.time() - lag_s, GO), lambda: f"3.00 s {way}" in advice(told), 8.0)
    assert robot.inner.state().linear_m_s == 0.0
    assert sum(robot.governed.refused.values()) > 5
    assert refused in robot.governed.refused


def advice(reader):
    newest = reader.newest()
    if newest is None:
        return ""
    governor = next(each for each in newest.message.status if each.name.endswith("governor"))
    return " ".join(value for key, value in governor.values if key == "advice")


def test_a_ros2_teleop_at_2_hz_is_told_why_it_does_not_drive(scene, capfd):
    robot, bus, ros = scene
    told = bus.reader(DIAGNOSTICS)
    repeat(ros, lambda: encode(GO), lambda: "each counts for 0.25 s" in advice(told), 10.0, pause_s=0.5)
    assert "repeat_rate" in advice(told)
    assert robot.inner.state().linear_m_s == 0.0
    assert capfd.readouterr().err.count("repeat_rate") == 1


def test_who_forgets_the_zero_is_told_and_who_sends_another_type_as_well(scene):
    _, bus, ros = scene
    told = bus.reader(DIAGNOSTICS)
    repeat(ros, lambda: encode(GO), lambda: "waits for a zero" in advice(told))
    repeat(ros, lambda: b"\x00\x01\x00\x00" + bytes(12), lambda: "neither geometry_msgs/Twist" in advice(told))


def test_a_viewer_with_one_link_raises_no_alarm_and_who_commands_over_one_does(scene):
    """As a bridge or a viewer in mode `peer` comes: one link, over TCP."""
    robot, bus, _ = scene
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("listen/endpoints", "[]")
    config.insert_json5("connect/endpoints", f'["tcp/{robot.endpoint}?rel=1"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("timestamping/enabled", "true")
    viewer = zenoh.open(config)
    told = bus.reader(DIAGNOSTICS, 8)

    def levels(least):
        found = []
        wait_for(lambda: found.extend(told.poll()) or len(found) >= least, 15.0)
        return [next(s for s in each.message.status if s.name.endswith("link")).level for each in found]

    wait_for(lambda: robot._bus.short_peers() == 1)
    assert set(levels(5)) == {OK}
    link = next(each for each in told.newest().message.status if each.name.endswith("link"))
    assert "connects as a client hears all" in dict(link.values)["peers with one link"]
    until_s = time.monotonic() + 15.0
    while levels(1)[-1] != WARN:
        assert time.monotonic() < until_s
        viewer.put(f"{robot.name}/cmd_vel", encode(STOP))
    viewer.close()


def test_each_ros2_peer_has_a_lease_of_its_own(scene):
    robot, _, one = scene
    repeat(one, lambda: encode(STOP), lambda: robot.governed.state == "armed")
    two = Ros(robot)
    repeat(
        one, lambda: two.put(encode(GO)) or encode(STOP), lambda: robot.governed.refused.get("another commander", 0) > 3
    )
    assert robot.inner.state().linear_m_s == 0.0
    two.close()


def noted(times_s, age_s=None, moves=True):
    return [Noted(each, age_s, moves) for each in times_s]


@pytest.mark.parametrize(
    ("stream", "armed", "words"),
    [
        (noted([7.0, 7.5, 8.0, 8.5, 9.0]), False, "2.0 times a second"),
        (noted([8.8 + 0.05 * k for k in range(24)]), False, "waits for a zero"),
        (noted([8.8 + 0.05 * k for k in range(24)]), True, ""),
        (noted([8.8 + 0.05 * k for k in range(24)], age_s=0.1), True, ""),
        (noted([8.8 + 0.05 * k for k in range(24)], age_s=1.5), True, "1.50 s behind"),
        (noted([8.8 + 0.05 * k for k in range(24)], age_s=-1.5), True, "1.50 s ahead of"),
        (noted([7.0, 7.5, 8.0, 8.5, 9.0], moves=False), False, ""),  # somebody says at leisure that it shall stand
        (noted([9.0, 9.5]), False, ""),
        (noted([1.0, 1.5, 2.0, 2.5]), False, ""),  # long ago
    ],
)
def test_what_is_told_to_a_ros2_peer(stream, armed, words):
    watch = CommandWatch()
    for each in stream:
        watch.note_ros("cmd_vel", "a", 0.25, each)
    told = watch.advice(10.0, armed=armed)
    assert (words in told[0]) if words else told == ()


def test_many_peers_fill_nothing():
    watch = CommandWatch()
    for count in range(1000):
        watch.note_sender(f"{count}", float(count))
        watch.note_ros("cmd_vel", f"{count}", 0.25, Noted(float(count), None, True))
    assert len(watch._streams) <= 64
    assert len(watch.commanders(1000.0)) <= 11


def test_the_stamp_of_twist_stamped_is_read_by_the_robots_own_clock():
    name, endpoint = new_name(), new_endpoint()
    robot, client = Bus(name, listen=endpoint), Bus(name, connect=endpoint)
    robot.count_from_1970(lambda: 100.0)
    reader, ready = robot.reader(CMD_VEL), client.publisher(CMD_VEL)
    wait_for(lambda: ready.matching)
    client.put_raw(CMD_VEL, twist_stamped(robot.offset_s + 99.5, GO))
    wait_for(lambda: reader.newest() is not None)
    message = reader.newest().message
    assert isinstance(message, TwistStamped)
    assert message.stamp_s == pytest.approx(99.5, abs=1e-5)
    assert client.close()
    assert robot.close()
