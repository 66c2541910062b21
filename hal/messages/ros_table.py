"""Our messages as ROS 2 messages: a pair of functions for each, by family, and the table of them all."""

from lira.hal.messages import ros_description as description
from lira.hal.messages import ros_learning as learning
from lira.hal.messages import ros_motion as motion
from lira.hal.messages import ros_operation as operation
from lira.hal.messages import ros_sensing as sensing
from lira.hal.messages.ros_types import TYPES, Codec, definition

__all__ = ["CODECS", "TYPES", "definition"]

CODECS: dict[type, Codec] = motion.CODECS | sensing.CODECS | operation.CODECS | learning.CODECS | description.CODECS
