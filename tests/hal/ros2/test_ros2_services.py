"""What a robot answers to ROS: std_srvs/Trigger through a bridge, under its own keys, and not to who asks for all."""

import json
import time

import pytest
import zenoh
from trigger import REQUEST, read_answer
from wiring import joined, real_time_null, served

from lira.hal.bus.services import look_at_estop
from lira.hal.bus.topics import INFO


@pytest.fixture
def robot():
    with served(real_time_null()) as robot:
        yield robot


@pytest.fixture
def guest(robot):
    """A session of nobody's of ours, as a bridge has it."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["tcp/{robot.endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    session = zenoh.open(config)
    yield session
    session.close()


def ask(session, key, payload=REQUEST):
    """All replies, each with the key it came under."""
    return [
        (str(reply.ok.key_expr), bytes(reply.ok.payload))
        for reply in session.get(key, payload=payload, timeout=3.0, target=zenoh.QueryTarget.ALL)
        if reply.ok is not None
    ]


def trigger(session, key):
    ((told, payload),) = ask(session, key)
    assert told == key
    return read_answer(payload)


def test_a_ros2_service_presses_and_releases_the_emergency_stop(robot, guest):
    with joined(robot) as bus:
        pressed = trigger(guest, f"{robot.name}/estop/press")
        assert (pressed.success, json.loads(pressed.message)["state"]) == (True, "emergency")
        assert look_at_estop(bus).pressed
        assert json.loads(trigger(guest, f"{robot.name}/estop/look").message)["state"] == "emergency"
        assert trigger(guest, f"{robot.name}/estop/release").success
        assert not look_at_estop(bus).pressed


def test_a_ros2_service_starts_a_twin_afresh_and_says_who_it_is(robot, guest):
    assert trigger(guest, f"{robot.name}/sim/reset").success
    assert json.loads(trigger(guest, f"{robot.name}/{INFO}").message)["profile"]["name"] == "thesis-sim"


def test_what_cannot_be_done_is_answered_to_ros2_as_well(robot, guest):
    def broken(_):
        raise RuntimeError("no")

    robot.inner.reset = broken
    assert not trigger(guest, f"{robot.name}/sim/reset").success


def test_a_bridge_of_ros2_finds_topics_and_services_by_their_tokens(robot, guest):
    """As zenoh-bridge-ros2dds does it: tokens below its own space, slashes written otherwise."""
    found, until_s = {}, time.monotonic() + 5.0
    while "camera/color/camera_info" not in found and time.monotonic() < until_s:
        for reply in guest.liveliness().get("@/*/@ros2_lv/**", timeout=3.0):
            kind, key, ros_type, *qos = str(reply.ok.key_expr).split("/")[3:]
            found[key.replace("§", "/").removeprefix(f"{robot.name}/")] = (kind, ros_type.replace("§", "/"), qos)
    assert found["scan"] == ("MP", "sensor_msgs/msg/LaserScan", [":::"])
    assert found["tf"] == ("MP", "tf2_msgs/msg/TFMessage", [":::"])
    assert found["tf_static"] == ("MP", "tf2_msgs/msg/TFMessage", ["::1:0,1"])
    assert found["robot_description"] == ("MP", "std_msgs/msg/String", ["::1:0,1"])
    assert found["estop/release"] == ("SS", "std_srvs/srv/Trigger", [])
    assert found["sim/reset"][0] == "SS"
    assert not {"cmd_vel", "cmd_vel/teleop"} & found.keys()


@pytest.mark.parametrize("expression", ["**", "*/estop/*", "{name}/**", "{name}/estop/*", "{name}/sim/*"])
@pytest.mark.parametrize("payload", [REQUEST, b""])
def test_who_asks_all_keys_presses_releases_and_resets_nothing(robot, guest, expression, payload):
    with joined(robot) as bus:
        press = ask(guest, f"{robot.name}/estop/press", b"")
        assert json.loads(press[0][1])["state"] == "emergency"
        resets = []
        robot.inner.reset = resets.append
        assert ask(guest, expression.format(name=robot.name), payload) == []
        assert look_at_estop(bus).pressed
        assert resets == []
