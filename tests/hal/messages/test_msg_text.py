"""Our reader of message definitions beside that of rosbags, which reads all of the language and takes longer."""

from importlib import resources

import pytest
from fresh import python
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lira.hal.messages.ros.msg_text import read, read_all
from lira.hal.messages.ros.types import TYPES, all_types, definition, types_with

MESSAGES = resources.files("lira.hal.messages")
OURS = {entry.name: entry.read_text() for entry in (MESSAGES / "msg").iterdir() if entry.name.endswith(".msg")}
STORES = {
    Stores.ROS2_JAZZY: MESSAGES / "jazzy.msg",
    Stores.ROS1_NOETIC: resources.files("lira.robot.core2") / "noetic.msg",
}


@pytest.mark.parametrize("file", OURS)
def test_it_reads_our_own_as_rosbags_does(file):
    name = f"lira_msgs/msg/{file.removesuffix('.msg')}"
    assert read(OURS[file], name) == get_types_from_msg(OURS[file], name)


@pytest.mark.parametrize("store", STORES, ids=lambda store: store.value)
def test_what_we_hold_of_ros_is_what_ros_has(store):
    held, theirs = read_all(STORES[store].read_text()), get_typestore(store).fielddefs
    ros = {name for name in held if not name.startswith("lira")}
    assert len(ros) > 10
    assert {name: held[name] for name in ros} == {name: theirs[name] for name in ros}


def test_comments_arrays_constants_and_defaults_are_read():
    text = "# a comment\nuint8 MOST=3  # of them\nint8 LEAST = -1\n\nfloat64[9] k\nFoo[] many\nfloat64 w 1.0\n"
    assert read(text, "pkg/msg/Type") == {
        "pkg/msg/Type": (
            [("MOST", "uint8", 3), ("LEAST", "int8", -1)],
            [("k", (3, ((1, ("float64", 0)), 9))), ("many", (4, ((2, "pkg/msg/Foo"), 0))), ("w", (1, ("float64", 0)))],
        )
    }


@pytest.mark.parametrize("line", ["float64", "string<=9 name", "float64[<=3] few", "int32 a b c", "string WORD=x"])
def test_what_it_does_not_read_it_refuses(line):
    with pytest.raises(ValueError, match="pkg/msg/Type: no field and no constant"):
        read(line, "pkg/msg/Type")


def test_a_type_that_only_others_send_is_known_and_one_that_nobody_has_is_not():
    assert types_with("sensor_msgs/msg/Image") is TYPES
    assert types_with("nav_msgs/msg/OccupancyGrid") is all_types()
    assert types_with("mylab_msgs/msg/Thing") is None
    assert definition("nav_msgs/msg/OccupancyGrid").startswith("std_msgs/Header header")
    assert definition("mylab_msgs/msg/Thing") == ""


def test_who_serves_a_robot_does_not_load_all_types_of_ros():
    code = "import sys, lira.hal.server.serve, lira.robot.rosbot; print([n for n in sys.modules if '.ros2_' in n])"
    done = python(code)
    assert (done.returncode, "rosbags" in done.stdout) == (0, False)
