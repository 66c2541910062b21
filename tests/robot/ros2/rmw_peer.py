"""The far side of rmw_zenoh: a router, and a robot's node on it, by its documentation and sources, without our code.

What rmw_zenoh does with a sample that comes: one without an attachment is dropped, and one whose attachment is not
33 bytes (int64, int64, a count of 16 and as many bytes) throws in the subscriber's callback. Here both are noted.
"""

import json
import struct
import time
from itertools import count

import zenoh
from ros2_peer import Peer
from zenoh import ext

STRING, TWIST, STAMPED, SCAN, PICTURE, ODOM = (
    "std_msgs::msg::dds_::String_",
    "geometry_msgs::msg::dds_::Twist_",
    "geometry_msgs::msg::dds_::TwistStamped_",
    "sensor_msgs::msg::dds_::LaserScan_",
    "sensor_msgs::msg::dds_::CompressedImage_",
    "nav_msgs::msg::dds_::Odometry_",
)
# As ROS 2 Kilted installs them; Jazzy's are the same.
HASHES = {
    TWIST: "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    STAMPED: "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    SCAN: "RIHS01_64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828",
    PICTURE: "RIHS01_15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
    ODOM: "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
}
TYPES = {
    "scan": SCAN,
    "camera/color/image_raw/compressed": PICTURE,
    "odom": ODOM,
}
UNHASHED = "TypeHashNotSupported"  # what Humble's rmw_zenoh has instead


def open_session(mode, *, listen=None, connect=None):
    """A session as rmw_zenoh configures it: a router, or a node that is a peer and knows the router."""
    config = zenoh.Config()
    config.insert_json5("mode", json.dumps(mode))
    config.insert_json5("listen/endpoints", json.dumps([f"tcp/127.0.0.1:{listen or 0}"]))
    config.insert_json5("connect/endpoints", json.dumps([f"tcp/127.0.0.1:{connect}"] if connect else []))
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("scouting/gossip/enabled", "true")
    config.insert_json5("timestamping/enabled", "true")
    return zenoh.open(config)


def token(domain, session, number, kind, node, *endpoint):
    parts = ["@ros2_lv", domain, session.zid(), 0, number, kind, "%", "%", node, *endpoint]
    return "/".join(str(part).replace("/", "%") for part in parts)


class RmwPeer(Peer):
    """A robot whose ROS runs rmw_zenoh. `hashed` False: Humble's, which names no hashes."""

    def __init__(self, port, namespace="", domain=0, stamped=False, hashed=True, attach="rmw_zenoh's attachment"):
        self._domain, self._hashed = domain, hashed
        self._command = STAMPED if stamped else TWIST
        self._numbers = count(10)
        self.refused = []  # what a subscriber of rmw_zenoh would have dropped or failed on
        self.numbers = []
        super().__init__(port, namespace, attach)

    def _open(self, port, datagrams):
        self._router = open_session("router", listen=port)
        session = open_session("peer", connect=port)
        self._declare(session, token(self._domain, session, 0, "NN", "rosbot"))
        return session

    def _key(self, topic):
        return f"{self._domain}/{self._prefix}{topic}/{self._kind(topic)}/{self._hash(self._kind(topic))}"

    def _kind(self, topic):
        return self._command if topic == "cmd_vel" else TYPES[topic]

    def _hash(self, kind):
        return HASHES[kind] if self._hashed else UNHASHED

    def _declare(self, session, key):
        self._tokens.append(session.liveliness().declare_token(key))

    def _announce(self, kind, topic):
        name, type_name = f"/{self._prefix}{topic}", self._kind(topic)
        endpoint = name, type_name, self._hash(type_name), "::,10:,:,:,,"
        self._declare(self._session, token(self._domain, self._session, next(self._numbers), kind, "rosbot", *endpoint))

    def _subscribe(self):
        for topic in TYPES:
            self._announce("MP", topic)
        self._announce("MS", "cmd_vel")
        return ext.declare_advanced_subscriber(self._session, self._key("cmd_vel"), self._hear)

    def _hear(self, sample):
        attached = sample.attachment
        if attached is None or len(bytes(attached)) != 33 or bytes(attached)[16] != 16:
            self.refused.append(None if attached is None else bytes(attached))
            return
        number, stamp_ns = struct.unpack_from("<qq", bytes(attached))
        assert abs(stamp_ns - time.time_ns()) < 10e9
        self.numbers.append(number)
        super()._hear(sample)

    def close(self):
        super().close()
        self._router.close()
