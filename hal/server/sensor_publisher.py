"""What a HAL server sends: sensors when they are new, images compressed."""

import math
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np

from lira.hal.bus.bus import Bus, Publisher
from lira.hal.bus.topics import BATTERY, CAMERA, DEPTH, IMU, LOCKSTEP, ODOM, RANGES, SCAN, Qos, Topic
from lira.hal.errors import SensorError
from lira.hal.messages import CompressedImage, DepthImage, Image, Observation
from lira.hal.profile import Camera

# Over it, an image holds up its publisher for 50 ms on a slow link before it is dropped.
IMAGE_LIMIT_BYTES = 64_000
JPEG_QUALITIES = (90, 75, 50, 25)
DEPTH_STEPS = (1, 2, 4)  # every so many pixels of every so many rows


class Outlet:
    """Publishes the parts of observations. With `lockstep` all of them each time, else only those that are new.

    Images and depths are left to the caller: they are slow, and may be sent from a thread of their own.
    """

    def __init__(self, bus: Bus, camera: Camera, *, lockstep: bool) -> None:
        self._qos: Qos | None = LOCKSTEP if lockstep else None
        self._bus = bus
        self._camera = camera
        self._only_new = not lockstep
        self._sent_s: dict[str, float] = {}
        topics: list[Topic[Any]] = [SCAN, ODOM, IMU, BATTERY, *RANGES.values()]
        self._publishers: dict[str, Publisher[Any]] = {t.key: bus.publisher(t, self._qos) for t in topics}
        self._images = bus.publisher(CAMERA, self._qos)
        self._depths = bus.publisher(DEPTH, self._qos)

    @property
    def image_wanted(self) -> bool:
        """Whether anybody listens to the camera."""
        return self._images.matching

    @property
    def depth_wanted(self) -> bool:
        """Whether anybody listens to the depth camera."""
        return self._depths.matching

    def put(self, observation: Observation, now_s: float) -> None:
        """Publish everything but the image."""
        for topic, message in _parts(observation):
            if self._only_new and self._sent_s.get(topic.key) == message.stamp_s:
                continue
            self._sent_s[topic.key] = message.stamp_s
            with self._bus.boundary.guard(topic.key):
                self._publishers[topic.key].put(message, now_s, seq=observation.seq)

    def put_image(self, observation: Observation, now_s: float) -> None:
        """Publish the image, compressed as the profile says. Raises `SensorError` if that fails."""
        image = observation.image
        if image is None or (self._only_new and self._sent_s.get(CAMERA.key) == image.stamp_s):
            return
        self._sent_s[CAMERA.key] = image.stamp_s
        compressed = compress(image, self._camera.encoding) if isinstance(image, Image) else image
        self._images.put(compressed, now_s, seq=observation.seq)

    def put_depth(self, observation: Observation, now_s: float) -> None:
        """Publish the depth image, if it is time for one."""
        depth = observation.depth
        if depth is None or depth.stamp_s - self._sent_s.get(DEPTH.key, -math.inf) < 1.0 / DEPTH.rate_hz:
            return
        self._sent_s[DEPTH.key] = depth.stamp_s
        self._depths.put(compress_depth(depth), now_s, seq=observation.seq)


def _parts(observation: Observation) -> Iterator[tuple[Topic[Any], Any]]:
    single = (
        (SCAN, observation.scan),
        (ODOM, observation.odom),
        (IMU, observation.imu),
        (BATTERY, observation.battery),
    )
    yield from ((topic, message) for topic, message in single if message is not None)
    yield from ((RANGES[message.frame_id], message) for message in observation.ranges)


def compress(image: Image, encoding: str) -> CompressedImage:
    """Compress to "png", or to "jpeg" at the best quality that fits the limit. Raises `SensorError`."""
    pixels = image.data[..., ::-1] if image.encoding == "rgb8" else image.data
    if encoding == "png":
        return CompressedImage(image.stamp_s, _encode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 1]), "png")
    for quality in JPEG_QUALITIES:
        data = _encode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
        if len(data) <= IMAGE_LIMIT_BYTES:
            break
    return CompressedImage(image.stamp_s, data, "jpeg")


def compress_depth(depth: DepthImage) -> CompressedImage:
    """Compress to a PNG of 16 bits that fits the limit. Pixels are left out, never mixed: 0 is no distance."""
    for step in DEPTH_STEPS:
        data = _encode(".png", depth.data[::step, ::step], [cv2.IMWRITE_PNG_COMPRESSION, 1])
        if len(data) <= IMAGE_LIMIT_BYTES:
            break
    return CompressedImage(depth.stamp_s, data, "png")


def _encode(extension: str, pixels: Any, options: list[int]) -> bytes:
    try:
        done, data = cv2.imencode(extension, np.ascontiguousarray(pixels), options)
    except cv2.error as error:
        raise SensorError(f"an image of shape {pixels.shape} does not compress: {error}") from error
    if not done:
        raise SensorError(f"an image of shape {pixels.shape} does not compress")
    return data.tobytes()
