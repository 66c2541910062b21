"""What is known of ROS images: names, types, mounting, multiplexer; and what is missing is told."""

import time
from contextlib import closing, contextmanager

import pytest
from ros2_peer import Peer, twist_cdr
from ros2_rig import wait_for

from lira.hal.bus.bus import Bus
from lira.hal.errors import ConfigError
from lira.hal.messages import STOP, Command, Source, Twist
from lira.hal.profile import load_profile
from lira.hal.rmw.tokens import Kind, Route
from lira.hal.ros_graph.look import Sight
from lira.robot.ros2.image import known_images, load_image
from lira.robot.ros2.robot import Interface, Ros2Robot
from lira.tools.cli import main
from lira.tools.launch.processes import ChildProcess, free_port, lira_command
from lira.tools.ros2.wants import Place, commanded, published

GO = Twist(0.3, 0.5)
TWIST, STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"


@pytest.mark.parametrize("name", known_images())
def test_every_ros2_image_is_whole(name):
    image = load_image(name)
    Interface(image.choose())  # its names are those of our sensors
    assert load_profile(image.profile)
    assert image.description
    for topics in image.topics.values():
        assert topics
        assert all(not topic.startswith("/") for topic in topics)


def test_a_ros2_image_of_ones_own_is_a_file_and_a_wrong_one_is_refused(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    path.write_text('description = "mine"\nprofile = "rosbot2"\nstamped = true\n[topics]\nodom = ["wheel_odom"]\n')
    assert load_image(str(path)).choose() == {"odom": "wheel_odom"}
    path.write_text('description = "mine"\nprofile = "rosbot2"\nstamped = true\nmounted = 3\n')
    with pytest.raises(ConfigError, match="mounted"):
        load_image(str(path))
    with pytest.raises(ConfigError, match="unknown image 'rosbot-foxy'"):
        load_image("rosbot-foxy")
    assert main(["ros2", "--image", "list"]) == 0
    assert "rosbot-jazzy" in capsys.readouterr().out
    assert main(["ros2", "--image", "rosbot-jazzy"]) == 2
    assert "no --connect" in capsys.readouterr().err


def route(kind, key, ros_type):
    return Route("0", kind, key, ros_type)


def test_of_the_names_of_a_ros2_image_those_count_that_are_there():
    image = load_image("rosbot-jazzy")
    said = [route(Kind.PUBLISHER, f"robot1/{name}", "?") for name in ("odometry/wheels", "imu/data", "oak/rgb/x")]
    sight = Sight(routes=(*said, route(Kind.PUBLISHER, "other/odometry/filtered", "?")))
    there = published(sight, Place(None, "/robot1/"))
    assert there == {"odometry/wheels", "imu/data", "oak/rgb/x"}
    assert image.choose(there)["odom"] == "odometry/wheels"
    assert image.choose()["odom"] == "odometry/filtered"
    assert published(sight, Place(3)) == set()


@pytest.mark.parametrize(
    ("heard", "asked", "image", "stamped"),
    [
        ((), None, None, False),
        ((), None, "rosbot-jazzy", True),
        ((), None, "rosbot-humble", False),
        ((), "twist", "rosbot-jazzy", False),
        ((TWIST,), None, "rosbot-jazzy", False),  # what is there goes before what is known
        ((STAMPED,), None, "rosbot-humble", True),
    ],
)
def test_a_ros2_robot_is_commanded_as_it_says_or_as_its_image_is_known_for(heard, asked, image, stamped):
    sight = Sight(routes=tuple(route(Kind.SUBSCRIPTION, "cmd_vel", each) for each in heard))
    found = commanded(sight, Place(None), "/cmd_vel", asked, None if image is None else load_image(image))
    assert found.stamped is stamped


def test_asking_for_what_a_ros2_robot_does_not_hear_is_refused():
    sight = Sight(routes=(route(Kind.SUBSCRIPTION, "cmd_vel", STAMPED),))
    with pytest.raises(ConfigError, match="listens to no twist on 'cmd_vel'"):
        commanded(sight, Place(None), "cmd_vel", "twist", None)


class Mux(Peer):
    """A robot whose multiplexer puts `manual/cmd_vel` before `cmd_vel`."""

    def __init__(self, port):
        self.manual = []
        super().__init__(port)
        self._hand = self._session.declare_subscriber(
            "manual/cmd_vel", lambda sample: self.manual.append((time.monotonic(), bytes(sample.payload)))
        )


@contextmanager
def driven():
    with closing(Mux(port := free_port())) as there:
        bus = Bus("far", connect=f"127.0.0.1:{port}", prefix="")
        robot = Ros2Robot(load_profile("thesis-sim"), bus, Interface(manual="/manual/cmd_vel"))
        robot.open()
        try:
            yield there, robot
        finally:
            robot.close()
            assert bus.close()


def drive(robot, twist, source, seconds=0.2):
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        robot.read()
        robot.drive(Command(twist, robot.now(), source))
        time.sleep(0.01)


def test_policy_leaves_the_first_topic_of_a_ros2_mux_to_others():
    with driven() as (there, robot):
        drive(robot, GO, Source.POLICY)
        drive(robot, STOP, Source.NONE)
        wait_for(lambda: any(payload == twist_cdr(0.3, 0.5) for _, payload in there.commands))
        assert there.manual == []


def test_the_hand_drives_by_the_first_topic_of_a_ros2_mux_and_leaves_it_with_a_zero():
    with driven() as (there, robot):
        drive(robot, GO, Source.TELEOP)
        wait_for(lambda: there.manual and there.manual[-1][1] == twist_cdr(0.3, 0.5))
        assert there.commands[-1][1] == twist_cdr(0.0, 0.0)
        drive(robot, STOP, Source.NONE, 0.6)
        assert there.manual[-1][1] == twist_cdr(0.0, 0.0)
        left_s = there.manual[-1][0]
        drive(robot, GO, Source.POLICY)
        assert there.manual[-1][0] == left_s
        wait_for(lambda: there.commands[-1][1] == twist_cdr(0.3, 0.5))


def test_the_emergency_stop_holds_the_first_topic_of_a_ros2_mux():
    with driven() as (there, robot):
        drive(robot, GO, Source.POLICY)
        robot.cut_motors(True)
        drive(robot, STOP, Source.NONE, 0.5)
        assert len(there.manual) >= 5
        assert {payload for _, payload in there.manual} == {twist_cdr(0.0, 0.0)}
        robot.cut_motors(False)
        drive(robot, STOP, Source.NONE)
        last_s = there.manual[-1][0]
        drive(robot, STOP, Source.NONE, 0.3)
        assert there.manual[-1][0] == last_s


def test_lira_ros2_with_an_image_says_what_is_missing(tmp_path):
    far_port, near_port = free_port(), free_port()
    words = ["ros2", "--connect", f"127.0.0.1:{far_port}", "--name", f"r{near_port}"]
    words += ["--listen", f"127.0.0.1:{near_port}", "--image", "rosbot-jazzy"]
    child = ChildProcess("the server", lira_command(*words), tmp_path / "ros2.log")
    with closing(Peer(far_port, command="TwistStamped")), child as server:
        server.wait_ready("serves on", 30.0)
        server.wait_ready("nothing comes on 'odometry/filtered', so there is no odom", 15.0)
        server.wait_ready("nothing comes on 'imu/data', so there is no imu", 5.0)
        server.wait_ready("autonomous/cmd_vel", 5.0)
        assert "a Twist carries no time" not in server.output()
        assert server.stop() == 0


def test_what_comes_is_not_missing():
    with driven() as (_, robot):
        wait_for(lambda: robot.read().odom is not None)
        assert robot.missing() == {}
