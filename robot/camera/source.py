"""One port for every source of pictures, and which URL names which."""

from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

from lira.hal.errors import ConfigError
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


def open_source(url: str, size: tuple[int, int], openni_folder: Path | None, *, depth: bool = False) -> Source:
    """Open `openni:`, `http(s)://` (MJPEG), `rtsp://`, `/dev/video0` or a folder of images.

    `size` (width, height) is asked of sources that have a choice. Raises `DeviceError`, or `ConfigError` for a URL of
    none of these forms, or one of a source that has no `depth`.
    """
    try:
        scheme = urlsplit(url).scheme
    except ValueError as error:
        raise ConfigError(f"'{url}' is no address: {error}", "Give the camera's own address.") from error
    if depth and scheme != "openni":
        remedy = "Take [depth] out of the profile and depth = true out of the settings, or use openni:."
        raise ConfigError(f"'{url}' has no depth", remedy)
    if scheme == "openni":
        from lira.robot.camera.astra import OpenniSource

        return OpenniSource(url.removeprefix("openni:"), size, openni_folder, depth=depth)
    if scheme in ("http", "https"):
        from lira.robot.camera.mjpeg import MjpegSource

        return MjpegSource(url)
    if scheme in ("rtsp", "rtsps") or url.startswith("/dev/"):
        from lira.robot.camera.video import VideoSource

        return VideoSource(url, size)
    if Path(url).is_dir():
        from lira.robot.camera.folder import FolderSource

        return FolderSource(Path(url))
    raise ConfigError(
        f"'{url}' is no camera",
        "Use openni: (Astra), /dev/video0 (UVC), http://... (MJPEG), rtsp://..., or a folder of images.",
    )
