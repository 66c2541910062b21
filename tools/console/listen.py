"""The console's ears: the newest of everything on a watching bus, as a view."""

import math
import time
from dataclasses import replace
from typing import TypeVar

import cv2
import numpy as np

from lira.hal.bus.bus import Bus
from lira.hal.bus.reader import Received
from lira.hal.bus.topics import APPLIED, BATTERY, CAMERA, DECISION, ODOM, OPERATOR_ANSWER, SCAN
from lira.hal.messages import ByteArray, CompressedImage, Reason
from lira.hal.profile import RobotProfile
from lira.tools.console.state import View

M = TypeVar("M")


class Ears:
    """Keeps the newest; what comes between two looks is dropped."""

    def __init__(self, watch: Bus, profile: RobotProfile) -> None:
        self._scan, self._camera = watch.reader(SCAN), watch.reader(CAMERA)
        self._odom, self._applied = watch.reader(ODOM), watch.reader(APPLIED)
        self._decision, self._battery = watch.reader(DECISION), watch.reader(BATTERY)
        self._answer = watch.reader(OPERATOR_ANSWER)
        self._picture: ByteArray | None = None
        self._picture_s = -math.inf
        features, base = profile.features, profile.base
        self._view = View(
            watch.robot,
            fov_rad=features.fov_rad,
            max_range_m=features.max_range_m,
            limits=(base.max_linear_m_s, base.max_angular_rad_s),
        )

    def look(self) -> View:
        """The view now."""
        scan, odom, applied = self._scan.newest(), self._odom.newest(), self._applied.newest()
        decision, battery, answer = self._decision.newest(), self._battery.newest(), self._answer.newest()
        for received in self._camera.poll()[-1:]:
            self._picture, self._picture_s = decode_picture(received.message), received.arrived_s
        now_s = time.monotonic()
        return replace(
            self._view,
            scan=_message(scan),
            scan_age_s=_age_s(scan, now_s),
            camera=self._picture,
            camera_age_s=now_s - self._picture_s,
            odom=_message(odom),
            applied=_message(applied),
            link_age_s=_age_s(applied, now_s),
            decision=_message(decision),
            decision_age_s=_age_s(decision, now_s),
            battery=_message(battery),
            answer=_message(answer),
            answer_age_s=_age_s(answer, now_s),
            estop=applied is not None and applied.message.reason is Reason.ESTOP,
        )


def decode_picture(image: CompressedImage) -> ByteArray | None:
    """RGB pixels; None for what is no picture."""
    try:
        pixels = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        return None
    return None if pixels is None else np.ascontiguousarray(pixels[..., ::-1], np.uint8)


def _message(received: Received[M] | None) -> M | None:
    return None if received is None else received.message


def _age_s(received: Received[M] | None, now_s: float) -> float:
    return math.inf if received is None else now_s - received.arrived_s
