"""The far side of a bridge: keys, CDR and attachments by their specifications, written down without our codec.

No bridge runs here. The forms are those that zenoh-bridge-ros2dds's documentation and sources give: a ROS 2 topic
`/ns/name` is the key `ns/name`, the payload is the DDS sample's CDR with its header `00 01 00 00`, there is no
attachment, and the bridge is a router that listens on TCP. Attachments are those of rmw_zenoh, which another peer on
the same network may send.
"""

import itertools
import json
import struct
import threading
import time

import cv2
import numpy as np
import zenoh

GID = bytes(range(16))


def attachment_of(kind, number, stamp_ns):
    """What may be beside a payload; None for nothing."""
    named = b"\x0fsequence_number" + struct.pack("<q", number) + b"\x10source_timestamp" + struct.pack("<q", stamp_ns)
    return {
        "no attachment": None,
        "rmw_zenoh's attachment": struct.pack("<qqB", number, stamp_ns, 16) + GID,
        "rmw_zenoh's older attachment": named + b"\x0asource_gid\x10" + GID,
        "an attachment as long as ours": bytes(37),
    }[kind]


ATTACHMENTS = (
    "no attachment",
    "rmw_zenoh's attachment",
    "rmw_zenoh's older attachment",
    "an attachment as long as ours",
)


class Cdr:
    """Plain CDR, little-endian: each number is aligned to its size, counted from behind the header."""

    def __init__(self):
        self.data = b""

    def put(self, layout, *values):
        for value in values:
            size = struct.calcsize(layout)
            self.data += b"\0" * (-len(self.data) % size) + struct.pack(f"<{layout}", value)
        return self

    def text(self, text):
        self.put("I", len(text) + 1)
        self.data += text.encode() + b"\0"
        return self

    def header(self, stamp_ns, frame):
        return self.put("i", stamp_ns // 10**9).put("I", stamp_ns % 10**9).text(frame)

    def payload(self):
        return b"\x00\x01\x00\x00" + self.data


def scan_cdr(stamp_ns, ranges, start, step):
    cdr = Cdr().header(stamp_ns, "laser")
    cdr.put("f", start, start + step * (len(ranges) - 1), step, 0.0, 0.1, 0.15, 12.0)
    return cdr.put("I", len(ranges)).put("f", *ranges).put("I", 0).payload()


def picture_cdr(stamp_ns, jpeg):
    cdr = Cdr().header(stamp_ns, "camera").text("rgb8; jpeg compressed bgr8").put("I", len(jpeg))
    return cdr.payload() + jpeg


def odometry_cdr(stamp_ns, x_m, linear_m_s):
    cdr = Cdr().header(stamp_ns, "odom").text("base_link")
    cdr.put("d", x_m, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, *[0.0] * 36)
    return cdr.put("d", linear_m_s, 0.0, 0.0, 0.0, 0.0, 0.0, *[0.0] * 36).payload()


def twist_cdr(linear_m_s, angular_rad_s):
    return Cdr().put("d", linear_m_s, 0.0, 0.0, 0.0, 0.0, angular_rad_s).payload()


ROUTES = {
    "scan": "sensor_msgs/msg/LaserScan",
    "camera/color/image_raw/compressed": "sensor_msgs/msg/CompressedImage",
    "odom": "nav_msgs/msg/Odometry",
}


class Peer:
    """A robot behind a bridge. Its ROS clock is not this machine's. `silent` topics say nothing."""

    def __init__(self, port, namespace="", attach="no attachment", datagrams=False, command="Twist"):
        self._prefix = f"{namespace}/" if namespace else ""
        self._attach = attach
        self.port = port
        self._command_type = f"geometry_msgs/msg/{command}"
        self._tokens = []
        self._offset_ns = 1_700_000_000 * 10**9
        self._number = 0
        self.silent = set()
        self.commands = []
        self._session = self._open(port, datagrams)
        self._hears = self._subscribe()
        self._stop = threading.Event()
        pixels = np.full((48, 64, 3), 120, np.uint8)
        self._jpeg = cv2.imencode(".jpg", pixels)[1].tobytes()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _open(self, port, datagrams):
        config = zenoh.Config()
        listen = [f"tcp/127.0.0.1:{port}"]
        if datagrams:
            listen = [f"tcp/127.0.0.1:{port}?rel=1", f"udp/127.0.0.1:{port}?rel=0"]
            config.insert_json5("transport/unicast/max_links", "2")
        config.insert_json5("mode", '"peer"' if datagrams else '"router"')
        config.insert_json5("listen/endpoints", json.dumps(listen))
        config.insert_json5("scouting/multicast/enabled", "false")
        return zenoh.open(config)

    def _key(self, topic):
        return self._prefix + topic

    def _subscribe(self):
        """Hear commands, and announce what is routed as the bridge does to other bridges."""
        routes = {("MP", name): kind for name, kind in ROUTES.items()} | {("MS", "cmd_vel"): self._command_type}
        for (kind, name), type_name in routes.items():
            key, told = self._key(name).replace("/", "§"), type_name.replace("/", "§")
            token = f"@/{self._session.zid()}/@ros2_lv/{kind}/{key}/{told}/:::"
            self._tokens.append(self._session.liveliness().declare_token(token))
        return self._session.declare_subscriber(self._key("cmd_vel"), self._hear)

    def now_ns(self):
        return time.monotonic_ns() + self._offset_ns

    def ranges(self):
        """A wall 1 m before the unit's own front, 3 m elsewhere, one beam without a return."""
        ranges = np.full(360, 3.0)
        ranges[170:191] = 1.0
        ranges[0] = np.inf
        return ranges

    def _hear(self, sample):
        self.commands.append((self.now_ns(), bytes(sample.payload)))

    def _run(self):
        step = 2 * np.pi / 360
        for turn in itertools.count():
            if self._stop.wait(0.05):
                return
            now_ns = self.now_ns()
            self._say("odom", odometry_cdr(now_ns, 1.5, 0.25))
            self._say("camera/color/image_raw/compressed", picture_cdr(now_ns, self._jpeg))
            if turn % 2 == 0:
                self._say("scan", scan_cdr(now_ns, self.ranges(), -np.pi, step))

    def _say(self, topic, payload):
        self._number += 1
        if topic not in self.silent:
            attachment = attachment_of(self._attach, self._number, self.now_ns())
            self._session.put(self._key(topic), payload, attachment=attachment)

    def close(self):
        self._stop.set()
        self._thread.join()
        self._session.close()
