"""A made-up recording: two laps driven by a person, an expert and the novice, with pictures that can be told apart."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from lira.fusion.log.label_file import Demonstration
from lira.fusion.preprocess import Features, shapes_of
from lira.hal.bus.topics import APPLIED, CAMERA, DECISION, ODOM, SCAN
from lira.hal.messages import (
    Applied,
    Call,
    CompressedImage,
    Decision,
    ExpertView,
    LabelCounts,
    LaserScan,
    Odometry,
    Phase,
    Reason,
    Source,
    Twist,
)
from lira.hal.profile import load_profile
from lira.tools.export.pictures import color_pictures

PROFILE = load_profile("thesis-sim")
PERIOD_S = PROFILE.period_s
DRIVERS = ("human", "human", "camera", "novice", "novice")
LENGTHS = (5, 4)  # of the laps
HEIGHT, WIDTH = 48, 64


@dataclass(frozen=True)
class Message:
    key: str
    message: Any


def picture(number):
    """A gray level for each step, with a red edge on the left."""
    rgb = np.full((HEIGHT, WIDTH, 3), level(number), np.uint8)
    rgb[:, :16] = (200, 0, 0)
    return CompressedImage(stamp(number), cv2.imencode(".png", rgb[..., ::-1])[1].tobytes(), "png")


def level(number):
    return 40 + 20 * number


def stamp(number):
    return 100.0 + PERIOD_S * number


def scan(number):
    lidar = PROFILE.lidar
    ranges = np.full(lidar.beams, np.inf, np.float32)
    ranges[lidar.beams // 2] = 0.5 + 0.1 * number
    limits = lidar.range_min_m, lidar.range_max_m
    return LaserScan(stamp(number), -lidar.fov_rad / 2, lidar.increment_rad, *limits, ranges)


def decision(number, lap, driver, stored=0):
    experts = (
        ExpertView("camera", (1.0, 0.1 * number), 0.05, driver == "camera"),
        ExpertView("lab/wall:go", (0.5, -0.1), 0.01, False),
    )
    action = (0.9, 0.01 * number)
    return Decision(
        stamp(number), 1000 + number, driver, Call.ATTENTION if driver == "camera" else Call.NONE, action,
        (0.8, -0.01 * number), action if driver == "human" else None, experts, 0.03,
        LabelCounts(stored_human=stored), 10 * lap, 1, 0, Phase.TRAIN if lap == 1 else Phase.PROVE, lap,
    )  # fmt: skip


def recording():
    """The messages in the order in which they are heard: a decision is told a period after its observation."""
    number, stored = 0, 0
    for lap, length in enumerate(LENGTHS, start=1):
        for step in range(length):
            driver = DRIVERS[step] if lap == 1 else "novice"
            stored += driver == "human"
            yield Message(SCAN.key, scan(number))
            yield Message(CAMERA.key, picture(number))
            yield Message(ODOM.key, Odometry(stamp(number), 0.0, 0.0, 0.0, 0.1 * number, 0.2))
            yield Message(ODOM.key, Odometry(stamp(number) + PERIOD_S / 2, 0.0, 0.0, 0.0, 99.0, 99.0))
            twist = Twist(0.1, 0.05 * number)
            yield Message(DECISION.key, decision(number, lap, driver, stored))
            yield Message(APPLIED.key, Applied(Twist(7.0, 7.0), stamp(number), Source.POLICY, Reason.OK, (), 0, 0.0))
            yield Message(APPLIED.key, Applied(twist, stamp(number) + 0.1, Source.POLICY, Reason.OK, (), 0, 0.0))
            number += 1


def pictures(messages=None):
    """The pictures of a recording, as often as they are asked for."""
    found = [each.message for each in (recording() if messages is None else messages) if each.key == CAMERA.key]
    return color_pictures(lambda: iter(found))


def cameras(messages=None):
    """What has pictures."""
    found = pictures(messages)
    return {} if found.size is None else {"camera": found}


def label(number, driver, *, stored):
    """What the log of labels has of a step."""
    features = Features(**{name: np.zeros(shape, np.float32) for name, shape in shapes_of(PROFILE).items()})
    novice = (0.8, -0.01 * number)
    return Demonstration(stamp(number), 1000 + number, 1, driver, (0.9, 0.01 * number), novice, stored, features)
