"""The port that every source of pictures fits."""

from typing import Protocol

from lira.hal.messages import CompressedImage, DepthImage, Image

LARGEST_BYTES = 8_000_000  # a picture that is larger, or does not end, is none

Picture = Image | CompressedImage


class Source(Protocol):
    """Something that takes pictures. It is used by one thread, and every call comes back in time."""

    def grab(self, timeout_s: float) -> Picture | DepthImage | None:
        """Return the newest picture, or depth, with its time of capture on the monotonic clock; None after the time.

        Raises `SensorError` for a picture that cannot be read, `DeviceError` when the source is lost.
        """

    def close(self) -> None:
        """Let go of it. May be called twice."""
