"""What a robot's ROS image calls its topics, and how it wants to be driven: one TOML file for each, `images/*.toml`."""

from collections.abc import Collection
from importlib import resources
from pathlib import Path

from msgspec import field

from lira.hal.config import Table, load_toml
from lira.hal.errors import ConfigError


class Image(Table, frozen=True):
    """One image. `topics` names for a sensor, or cmd_vel, the topics that it may have: the first that is there counts.

    `manual` is a topic of its velocity multiplexer that goes before all others, "" without one. `lidar_yaw_deg` is how
    the frame of its scans is turned. `told` is whatever its owner has to know.
    """

    description: str
    profile: str
    stamped: bool
    lidar_yaw_deg: float = 0.0
    manual: str = ""
    topics: dict[str, tuple[str, ...]] = field(default_factory=dict)
    told: tuple[str, ...] = ()

    def choose(self, there: Collection[str] = ()) -> dict[str, str]:
        """Choose a topic for each name, of those that are `there`, the usual one where none is or nobody says."""
        return {
            name: next((each for each in topics if each in there), topics[0])
            for name, topics in self.topics.items()
            if topics
        }


def known_images() -> dict[str, str]:
    """What images there are, each with its description."""
    return {name: load_image(name).description for name in _names()}


def load_image(name_or_path: str) -> Image:
    """Load an image by its name, or a user's own by the path of its TOML file. Raises `ConfigError`."""
    if name_or_path.endswith(".toml"):
        return load_toml(Path(name_or_path), Image)
    names = _names()
    if name_or_path not in names:
        remedy = f"Known images: {', '.join(names)}; or give the path of a .toml file."
        raise ConfigError(f"unknown image '{name_or_path}'", remedy)
    return load_toml(Path(str(_folder() / f"{name_or_path}.toml")), Image)


def _folder() -> Path:
    return Path(str(resources.files("lira.robot.ros2") / "images"))


def _names() -> list[str]:
    return sorted(path.stem for path in _folder().glob("*.toml"))
