"""Our messages as ROS 2 messages: a pair of functions for each, by family, and the table of them all."""

from hal.ros import learning, motion, operation, sensing
from hal.ros.types import TYPES, Codec, definition

__all__ = ["CODECS", "TYPES", "definition"]

CODECS: dict[type, Codec] = motion.CODECS | sensing.CODECS | operation.CODECS | learning.CODECS
