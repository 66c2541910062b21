"""Which URL names which source of pictures."""

from pathlib import Path
from urllib.parse import urlsplit

from lira.hal.errors import ConfigError, MissingExtraError
from lira.robot.camera.address import parse_address, shown
from lira.robot.camera.port import Source

EXTRAS = {"openni": "robot", "av": "video"}  # which part of the installation brings what a source needs


def open_source(url: str, size: tuple[int, int], openni_folder: Path | None, *, depth: bool = False) -> Source:
    """Open `openni:`, `http(s)://` (MJPEG), `rtsp://`, `/dev/video0`, a video file or a folder of images.

    `size` (width, height) is asked of sources that have a choice. Raises `DeviceError`; `ConfigError` for a URL of none
    of these forms, or one of a source that has no `depth`; `MissingExtraError` if it needs what is not installed.
    """
    try:
        scheme = urlsplit(parse_address(url).url).scheme
    except ValueError as error:
        raise ConfigError(f"'{shown(url)}' is no address", "Give the camera's own address.") from error
    if depth and scheme != "openni":
        remedy = "Take [depth] out of the profile and depth = true out of the settings, or use openni:."
        raise ConfigError(f"'{shown(url)}' has no depth", remedy)
    try:
        source = _open(url, scheme, size, openni_folder, depth=depth)
    except ModuleNotFoundError as error:
        package = str(error.name).split(".")[0]
        if package not in EXTRAS:
            raise
        raise MissingExtraError(package, EXTRAS[package]) from error
    if source is None:
        raise ConfigError(
            f"'{shown(url)}' is no camera",
            "Use openni: (Astra), /dev/video0 (UVC), http://... (MJPEG), rtsp://..., a video, or a folder of images.",
        )
    return source


def _open(url: str, scheme: str, size: tuple[int, int], openni_folder: Path | None, *, depth: bool) -> Source | None:
    """Open what a scheme names; None if it names nothing. Each kind's packages are imported only for it."""
    if scheme == "openni":
        from lira.robot.camera.sources.astra import OpenniSource

        return OpenniSource(url.removeprefix("openni:"), size, openni_folder, depth=depth)
    if scheme in ("http", "https"):
        from lira.robot.camera.sources.mjpeg import MjpegSource

        return MjpegSource(url)
    if scheme in ("rtsp", "rtsps") or url.startswith("/dev/"):
        from lira.robot.camera.sources.video import VideoSource

        return VideoSource(url, size)
    if Path(url).is_dir():
        from lira.robot.camera.sources.folder import FolderSource

        return FolderSource(Path(url))
    if Path(url).is_file():
        from lira.robot.camera.sources.film import FilmSource

        return FilmSource(Path(url), size)
    return None
