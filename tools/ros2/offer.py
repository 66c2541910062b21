"""Offers a robot of ours to a graph of ROS 2 over rmw_zenoh: a peer of the robot on one side, a node on the other.

It is a process of its own, so that nothing in it costs the robot's control anything. To the robot it is a peer like any
other: what ROS commands is judged by the governor there, under the lease, and stops when this process does. What nobody
in the graph listens to is not fetched from the robot.
"""

import contextlib
import json
import secrets
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import msgspec

from lira.hal.bus.bus import Bus
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.reader import Reader, Received
from lira.hal.bus.services import ANSWER_S, EstopState, press_estop, release_estop
from lira.hal.bus.topics import (
    APPLIED,
    CLOCK,
    CMD_VEL,
    COMMANDS,
    DIAGNOSTICS,
    ESTOP,
    FROM_OPERATORS,
    PICTURE,
    RESET,
    TELEOP,
    TOPICS,
    Topic,
)
from lira.hal.clock import ClockEstimate
from lira.hal.errors import BusError
from lira.hal.messages import Bool, Episode, Source, Twist, TwistStamped, is_neutral
from lira.hal.rmw.attachment import parse_rmw_attachment
from lira.hal.rmw.services import TRIGGER, Answer
from lira.hal.ros_graph.node import RosNode
from lira.tools.ros2.commanders import Commanders

