"""Messages as a robot sends them, and recordings made of them, for tests."""

import itertools

import cv2
import numpy as np

from lira.hal.bus.attachment import Attachment, parse_attachment
from lira.hal.bus.reader import RawSample
from lira.hal.bus.services import Info
from lira.hal.bus.topics import BATTERY, CAMERA, ODOM, SCAN
from lira.hal.messages import BatteryState, CompressedImage, LaserScan, Odometry
from lira.hal.messages.ros.codec import encode
from lira.hal.profile import load_profile
from lira.tools.recording.layout import Head
from lira.tools.recording.writer import RecordingWriter

BEGAN_NS = 1_700_000_000_000_000_000
OFFSET_NS = BEGAN_NS - 5_000_000_000  # the robot's clock says 5 s then
EPOCH = 2**64 - 7
INFO = Info(load_profile("thesis-sim"), "realtime", EPOCH)
HEAD = Head("rosbot", "0.1.0", OFFSET_NS, BEGAN_NS, INFO, "lira record")


def sample(topic, message, *, seq=0, sent_s=5.0, arrived_s=0.0, attachment=True):
    beside = Attachment(EPOCH, seq, round(sent_s * 1e9)).to_bytes() if attachment else None
    return RawSample(topic.key, topic.ros_type, encode(message), beside, arrived_s)


def odom(seq, sent_s):
    return sample(ODOM, Odometry(sent_s - 0.01, float(seq), 0.0, 0.0, 0.1, 0.0), seq=seq, sent_s=sent_s)


def scan(seq, sent_s):
    ranges = np.full(8, 1.5, np.float32)
    return sample(SCAN, LaserScan(sent_s - 0.02, -1.0, 0.25, 0.1, 4.0, ranges), seq=seq, sent_s=sent_s)


def picture(seq, sent_s):
    """Noise, which no compression makes smaller: about 2 kB."""
    noise = np.random.default_rng(seq).integers(0, 256, (44, 45), np.uint8)
    data = cv2.imencode(".png", noise)[1].tobytes()
    return sample(CAMERA, CompressedImage(sent_s - 0.03, data, "png"), seq=seq, sent_s=sent_s)


def battery(sent_s):
    return sample(BATTERY, BatteryState(sent_s, 12.0), sent_s=sent_s)


def drive(seconds, rate_hz=20):
    """Everything a robot sends in some seconds, in order."""
    yield battery(5.0)
    for number in range(seconds * rate_hz):
        sent_s = 5.0 + number / rate_hz
        yield odom(number, sent_s)
        if number % 2 == 0:
            yield scan(number, sent_s)
            yield picture(number, sent_s)


def write(folder, samples, *, split_bytes=2**30, close=True, aligned=False):
    """Write a recording, a message each millisecond, or `aligned` when it was sent.

    Without `close` it is as a killed process leaves it after its last flush.
    """
    writer = RecordingWriter(folder, HEAD, split_bytes=split_bytes)
    log_ns = itertools.count(BEGAN_NS, 1_000_000)
    for each in samples:
        now_ns = parse_attachment(each.attachment).time_ns + OFFSET_NS if aligned else next(log_ns)
        writer.add(each, now_ns, now_ns - 500_000, 3)
    if close:
        writer.close()
    else:
        writer.flush()
        writer.abandon()
    return writer
