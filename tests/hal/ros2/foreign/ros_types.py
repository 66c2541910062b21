"""Reads messages with ROS 2's own type support and writes them again: JSON of [type, hex] in, the same out.

Null is for a type of a package that is not installed there.
"""

import importlib
import json
import sys

from rclpy.serialization import deserialize_message, serialize_message


def again(name, data):
    package, _, kind = name.split("/")
    try:
        found = getattr(importlib.import_module(f"{package}.msg"), kind)
    except ModuleNotFoundError:
        return None
    return serialize_message(deserialize_message(bytes.fromhex(data), found)).hex()


print(json.dumps([[name, again(name, data)] for name, data in json.load(sys.stdin)]))
