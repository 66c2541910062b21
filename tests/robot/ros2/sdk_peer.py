"""A peer of rmw_zenoh by zenoh-ros2-sdk, which nobody here wrote: lists topics and services, listens, and drives.

It runs in the foreign environment, with the messages of the ROS 2 that is installed there: PORT SHARE SECONDS. What it
met it writes as one JSON object.
"""

import json
import os
import sys
import time
from pathlib import Path

import zenoh_ros2_sdk as sdk
from zenoh_ros2_sdk import discovery, message_registry

port, share, seconds = int(sys.argv[1]), Path(sys.argv[2]), float(sys.argv[3])
message_registry.get_registry(str(share))  # its own would be fetched from GitHub
AT = {"router_ip": "127.0.0.1", "router_port": port}
until_s = time.monotonic() + 20.0
while not (topics := dict(discovery.get_topic_names_and_types(**AT))) and time.monotonic() < until_s:
    time.sleep(0.2)
found = {
    "topics": topics,
    "services": dict(discovery.get_service_names_and_types(**AT)),
    "scan_info": vars(discovery.get_topic_info("/scan", verbose=True, **AT).publishers[0]),
    "came": {},
    "clock": [],
    "fastest": 0.0,
}
newest = {}


def listener(name):
    def hear(message):
        found["came"][name] = found["came"].get(name, 0) + 1
        newest[name] = message
        if name == "/odom":
            found["fastest"] = max(found["fastest"], message.twist.twist.linear.x)
        if name == "/scan":
            stamp = message.header.stamp
            found["clock"].append(time.time() - stamp.sec - stamp.nanosec / 1e9)

    return hear


KINDS = {
    "/scan": "sensor_msgs/msg/LaserScan",
    "/odom": "nav_msgs/msg/Odometry",
    "/camera/color/image_raw/compressed": "sensor_msgs/msg/CompressedImage",
    "/tf": "tf2_msgs/msg/TFMessage",
}
definitions = {"/tf": "geometry_msgs/TransformStamped[] transforms"}
hashes = {
    name: discovery.get_topic_info(name, verbose=True, **AT).publishers[0].type_hash for name in KINDS if name in topics
}
if "/tf" in hashes:
    sdk.message_registry.load_message_type("geometry_msgs/msg/TransformStamped")
held = [
    sdk.ROS2Subscriber(
        name,
        kind,
        listener(name),
        # What is not installed there it is told; all else it reads, and hashes, by itself.
        msg_definition=definitions.get(name),
        type_hash=hashes[name] if name in definitions else None,
        **AT,
    )
    for name, kind in KINDS.items()
    if name in topics
]
drive = sdk.ROS2Publisher("/cmd_vel", "geometry_msgs/msg/TwistStamped", **AT)
registry = message_registry.get_registry()
Twist, Vector3, Header, Time = (
    registry.get_message_class(kind)
    for kind in (
        "geometry_msgs/msg/Twist",
        "geometry_msgs/msg/Vector3",
        "std_msgs/msg/Header",
        "builtin_interfaces/msg/Time",
    )
)
began_s = time.monotonic()
while (passed_s := time.monotonic() - began_s) < seconds:
    forward = 0.0 if passed_s < seconds / 3 else 0.2  # at first the neutral command
    now_ns = time.time_ns()
    header = Header(stamp=Time(sec=now_ns // 10**9, nanosec=now_ns % 10**9), frame_id="base_link")
    twist = Twist(linear=Vector3(x=forward, y=0.0, z=0.0), angular=Vector3(x=0.0, y=0.0, z=0.0))
    drive.publish(header=header, twist=twist)
    time.sleep(0.05)
scan, odom, picture = newest.get("/scan"), newest.get("/odom"), newest.get("/camera/color/image_raw/compressed")
press = sdk.ROS2ServiceClient(
    "/estop/press",
    "std_srvs/srv/Trigger",
    request_definition="# nothing is asked",  # it refuses an empty one
    response_definition="bool success\nstring message",
    type_hash=discovery.get_service_info("/estop/press", verbose=True, **AT).servers[0].type_hash,
    **AT,
)
tries_s = time.monotonic() + 30.0
while ((answer := press.call()) is None or not answer.success) and time.monotonic() < tries_s:
    time.sleep(0.5)
found["press"] = None if answer is None else [answer.success, answer.message]
found["scan"] = None if scan is None else [scan.header.frame_id, len(scan.ranges), float(scan.angle_increment)]
found["odom"] = None if odom is None else odom.pose.pose.position.x
found["picture"] = None if picture is None else [picture.format, bytes(picture.data[:3]).hex()]
found["tf"] = (
    [[each.header.frame_id, each.child_frame_id] for each in newest["/tf"].transforms] if "/tf" in newest else None
)
print(json.dumps(found), flush=True)
os._exit(0)  # its session would keep the process
