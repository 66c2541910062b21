"""`lira ros2 --look` says what is at an address, whatever its form, and the words that it prints are the right ones."""

import argparse
import re
import shlex
from contextlib import closing
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rmw_peer import RmwPeer
from ros2_peer import Peer, odometry_cdr, picture_cdr, scan_cdr

from lira.hal.rmw.qos import RosQos
from lira.hal.rmw.tokens import Endpoint, Kind, Node, Route
from lira.hal.ros_graph.look import NOTHING, OURS, Heard, Sight
from lira.tools.cli import main
from lira.tools.launch.processes import free_port
from lira.tools.ros2.page import page
from lira.tools.ros2.sight import Found, Place, choose, guess, sort, words
from lira.tools.verbs.robots import ros2

SCAN, PICTURE, ODOM = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/CompressedImage", "nav_msgs/msg/Odometry"
TWIST, STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
JPEG = cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].tobytes()
NODE = Node(3, "abc", 0, "driver")


def drives(sight, address="rosbot:7447"):
    """The words that drive the one thing that is seen."""
    ((place, there),) = sort(sight).items()
    line = words(place, there, address)
    parser = argparse.ArgumentParser()
    ros2.add_arguments(parser)
    if line[:2] == ["lira", "ros2"]:
        parser.parse_args(line[2:])
    return shlex.join(line)


def routes(*told):
    return Sight(routes=tuple(Route("z", kind, key, ros_type) for kind, key, ros_type in told))


def test_a_bridge_with_and_without_a_namespace():
    said = (Kind.PUBLISHER, "robot1/scan", SCAN), (Kind.PUBLISHER, "robot1/odom", ODOM)
    hears = Kind.SUBSCRIPTION, "robot1/cmd_vel", STAMPED
    assert drives(routes(*said, hears)) == (
        "lira ros2 --connect rosbot:7447 --namespace robot1 --cmd-vel twist_stamped"
    )
    bare = (Kind.PUBLISHER, "scan", SCAN), (Kind.SUBSCRIPTION, "cmd_vel", TWIST)
    assert drives(routes(*bare)) == "lira ros2 --connect rosbot:7447 --cmd-vel twist"


def test_other_names_are_found_by_their_types_and_named_within_the_namespace():
    told = [
        (Kind.PUBLISHER, "robot1/scan", SCAN),
        (Kind.PUBLISHER, "robot1/oak/rgb/image_raw/compressed", PICTURE),
        (Kind.PUBLISHER, "robot1/oak/depth/compressed", PICTURE),
        (Kind.PUBLISHER, "robot1/odometry/filtered", ODOM),
        (Kind.SUBSCRIPTION, "robot1/base/cmd_vel", TWIST),
    ]
    assert drives(routes(*told)) == (
        "lira ros2 --connect rosbot:7447 --namespace robot1 --cmd-vel twist --topic "
        "camera=oak/rgb/image_raw/compressed --topic odom=odometry/filtered --topic cmd_vel=base/cmd_vel"
    )
    outside = [*told, (Kind.PUBLISHER, "battery", "sensor_msgs/msg/BatteryState")]
    assert "--namespace" not in drives(routes(*outside))
    assert "--topic scan=robot1/scan" in drives(routes(*outside))


def test_rmw_zenoh_by_domain_and_the_better_of_two_commands():
    def endpoint(kind, name, ros_type):
        return Endpoint(NODE, 1, kind, name, ros_type, "RIHS01_x", RosQos())

    sight = Sight(
        nodes=(NODE,),
        endpoints=(
            endpoint(Kind.PUBLISHER, "/scan", SCAN),
            endpoint(Kind.SUBSCRIPTION, "/cmd_vel", STAMPED),
            endpoint(Kind.SUBSCRIPTION, "/scan", SCAN),
            endpoint(Kind.SERVICE, "/dock", "std_srvs/srv/Trigger"),
        ),
    )
    assert drives(sight) == "lira ros2 --rmw --connect rosbot:7447 --domain 3 --cmd-vel twist_stamped"
    text = "\n".join(page(sight, "rosbot:7447"))
    assert "ROS 2 over rmw_zenoh, domain 3" in text
    assert "nodes: driver" in text
    assert "no camera" in text


def test_what_announces_nothing_is_known_by_what_it_sends():
    payloads = {
        "base_scan": scan_cdr(5, [1.0] * 8, 0.0, 0.1),
        "front/compressed": picture_cdr(5, JPEG),
        "odom": odometry_cdr(5, 1.0, 0.0),
        "noise": b"\0\1\0\0\1\2\3",
    }
    sight = Sight(heard=tuple(Heard(key, 10.0, 1, NOTHING, "", each) for key, each in payloads.items()))
    ((_, there),) = sort(sight).items()
    assert choose(there) == {"scan": "base_scan", "odom": "odom", "camera": "front/compressed"}
    assert "nobody says that it listens" in "\n".join(page(sight, "rosbot:7447"))


def test_one_of_ours_needs_no_words_of_this_verb():
    sight = Sight(heard=(Heard("rover/scan", 10.0, 1, OURS, SCAN),))
    assert drives(sight) == "lira drive lidar-expert --connect rosbot:7447 --name rover"


def test_what_ours_announces_to_bridges_makes_no_bridge_of_our_bus():
    announced = routes(
        (Kind.PUBLISHER, "rover/scan", SCAN),
        (Kind.PUBLISHER, "rover/tf_static", "tf2_msgs/msg/TFMessage"),
        (Kind.SERVICE, "rover/estop/press", "std_srvs/srv/Trigger"),
    )
    assert drives(announced) == "lira drive lidar-expert --connect rosbot:7447 --name rover"
    text = "\n".join(page(replace(announced, heard=(Heard("rover/scan", 9.0, 1, OURS, SCAN),)), "rosbot:7447"))
    assert "our own bus, robot 'rover'" in text
    assert "zenoh-bridge" not in text
    beside = replace(announced, routes=(*announced.routes, *routes((Kind.PUBLISHER, "scan", SCAN)).routes))
    assert {place.robot for place in sort(beside)} == {"rover", ""}


def test_of_topics_on_which_nothing_comes_that_is_said():
    said = (Kind.PUBLISHER, "scan", SCAN), (Kind.SUBSCRIPTION, "cmd_vel", TWIST)
    assert "nothing came on any of these topics" in page(routes(*said), "rosbot:7447")[-1]


def test_a_look_that_hears_nothing_ends_with_1_and_a_remedy(capsys, monkeypatch):
    monkeypatch.setattr("lira.hal.ros_graph.look.look", lambda *_: Sight())
    assert main(["ros2", "--look", "--connect", "127.0.0.1:1"]) == 1
    assert "ROS_DOMAIN_ID" in capsys.readouterr().out


def test_nothing_at_all_is_said():
    assert "nothing comes there" in page(Sight(), "rosbot:7447")[0]
    assert choose(Found()) == {}
    assert words(Place(), Found(), "rosbot:7447") == ["lira", "ros2", "--connect", "rosbot:7447"]


@given(st.binary(max_size=200))
def test_no_payload_does_harm(payload):
    assert isinstance(guess(payload), str)


@pytest.mark.parametrize(
    ("peer", "line"),
    [
        (Peer, "lira ros2 --connect 127.0.0.1:{port} --cmd-vel twist"),
        (
            lambda port: Peer(port, "robot1", command="TwistStamped"),
            "lira ros2 --connect 127.0.0.1:{port} --namespace robot1 --cmd-vel twist_stamped",
        ),
        (
            lambda port: RmwPeer(port, "robot1", domain=3),
            "lira ros2 --rmw --connect 127.0.0.1:{port} --domain 3 --namespace robot1 --cmd-vel twist",
        ),
    ],
)
def test_the_verb_lists_a_peer_of_each_form(peer, line, capsys, monkeypatch):
    monkeypatch.setattr("lira.tools.verbs.robots.ros2.LISTEN_S", 0.5)
    port = free_port()
    with closing(peer(port)):
        assert main(["ros2", "--look", "--connect", f"127.0.0.1:{port}"]) == 0
    told = capsys.readouterr().out
    assert line.format(port=port) in [each.strip() for each in told.splitlines()]
    assert re.search(r"scan +sensor_msgs/msg/LaserScan +[0-9.]+ +1500 ", told)
