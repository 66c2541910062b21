"""What a HAL server sends so that ROS knows where everything is: transforms, the model, what the cameras project."""

from typing import Any

from lira.hal.bus.bus import Bus
from lira.hal.bus.publisher import Publisher
from lira.hal.bus.sensors import sensors_of
from lira.hal.bus.topics import (
    APPLIED,
    CAMERA_INFO,
    DEPTH_INFO,
    DESCRIPTION,
    DIAGNOSTICS,
    ESTOP_LOOK,
    ESTOP_PRESS,
    ESTOP_RELEASE,
    IN_LOCKSTEP,
    INFO,
    RESET,
    SIM_STATE,
    TF,
    TF_STATIC,
    Topic,
)
from lira.hal.description.camera_info import info_for, pinhole
from lira.hal.description.frames import odometry_transform, static_transforms
from lira.hal.description.urdf import urdf_of
from lira.hal.messages import CameraInfo, CompressedImage, DepthImage, Image, Odometry, Text
from lira.hal.messages.images import size_of
from lira.hal.profile import RobotProfile

Picture = Image | DepthImage | CompressedImage
INFOS: dict[str, Topic[CameraInfo]] = {"camera": CAMERA_INFO, "depth": DEPTH_INFO}  # by sensor


class GraphPublisher:
    """Describes one robot. `calibration` is what its camera really projects, None for the profile's pinhole.

    In `lockstep` what belongs to an observation waits for room as that does, rather than be dropped.
    """

    def __init__(
        self, bus: Bus, profile: RobotProfile, calibration: CameraInfo | None = None, *, lockstep: bool = False
    ) -> None:
        self._bus = bus
        self._boundary = bus.boundary
        self._profile = profile
        self._calibration = calibration
        self._shown_s: dict[str, float] = {}  # of which picture it was told what it shows, by sensor
        topics: tuple[Topic[Any], ...] = (TF, TF_STATIC, DESCRIPTION, *INFOS.values())
        self._publishers: dict[str, Publisher[Any]] = {
            topic.key: bus.publisher(topic, IN_LOCKSTEP if lockstep and not topic.qos.latched else None)
            for topic in topics
        }

    def announce(self, *, arena: bool) -> None:
        """Make known to bridges to ROS 2 what the robot says and answers; what it is told it hears unannounced.

        A bridge would else make an announced command's type the only one that it passes on.
        """
        said: list[Topic[Any]] = [TF, TF_STATIC, DESCRIPTION, APPLIED, DIAGNOSTICS, *([SIM_STATE] if arena else [])]
        for sensor in sensors_of(self._profile):
            said += [sensor.topic, *([INFOS[sensor.name]] if sensor.name in INFOS else [])]
        for topic in said:
            self._bus.announce(topic)
        for key in (INFO, ESTOP_PRESS, ESTOP_RELEASE, ESTOP_LOOK, *([RESET] if arena else [])):
            self._bus.announce_service(key)

    def describe(self, now_s: float) -> None:
        """Publish what stays as it is, for all who ever come."""
        self._put(TF_STATIC, static_transforms(self._profile, now_s), now_s)
        self._put(DESCRIPTION, Text(urdf_of(self._profile)), now_s)

    def put_odometry(self, odom: Odometry, now_s: float) -> None:
        """Publish where the body is, if anybody listens."""
        if self._publishers[TF.key].matching:
            self._put(TF, odometry_transform(odom), now_s)

    def put_info(self, sensor: str, picture: Picture, now_s: float) -> None:
        """Publish what belongs to a picture, with its stamp, if anybody listens. `picture` as it is sent, if it is."""
        topic = INFOS[sensor]
        if self._shown_s.get(sensor) == picture.stamp_s or not self._publishers[topic.key].matching:
            return
        self._shown_s[sensor] = picture.stamp_s
        with self._boundary.guard(topic.key):
            size = _size(picture)
            calibrated = self._calibration if sensor == "camera" else None
            info = info_for(calibrated or pinhole(self._profile.camera, *size), size, picture.stamp_s)
            self._put(topic, info, now_s)

    def _put(self, topic: Topic[Any], message: object, now_s: float) -> None:
        with self._boundary.guard(topic.key):
            self._publishers[topic.key].put(message, now_s)


def _size(picture: Picture) -> tuple[int, int]:
    """Width and height. Raises `ValueError` for a compressed one without a header."""
    if isinstance(picture, CompressedImage):
        return size_of(picture.data)
    height, width = picture.data.shape[:2]
    return width, height
