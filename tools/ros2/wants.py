"""What a robot's own nodes say of its topics, against what its image is known for and what is asked for. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from lira.hal.errors import ConfigError
from lira.hal.rmw.tokens import Kind
from lira.hal.ros_graph.look import Sight
from lira.robot.ros2.image import Image
from lira.tools.ros2.sight import CMD_VEL_WORD, heard_commands


@dataclass(frozen=True)
class Place:
    """Where its topics are: in a `domain` of rmw_zenoh, or (None) behind a bridge, in a `namespace`."""

    domain: int | None
    namespace: str = ""

    def full(self, topic: str) -> str:
        """Name of a topic there, without a first slash."""
        return "/".join(part for part in (self.namespace.strip("/"), topic.strip("/")) if part)


@dataclass(frozen=True)
class Wanted:
    """How a robot wants its commands: with a stamp or without, and how it hashes the type."""

    stamped: bool = False
    hashes: Mapping[str, str] = field(default_factory=dict)


def published(sight: Sight, place: Place) -> set[str]:
    """Topics that are published there, by their names in the namespace."""
    prefix = place.full("")
    if place.domain is None:
        names = [each.key for each in sight.routes if each.kind is Kind.PUBLISHER]
    else:
        here = [each for each in sight.endpoints if each.node.domain == place.domain]
        names = [each.name.strip("/") for each in here if each.kind is Kind.PUBLISHER]
    return {name.removeprefix(prefix).strip("/") for name in names if not prefix or name.startswith(f"{prefix}/")}


def commanded(sight: Sight, place: Place, topic: str, asked: str | None, image: Image | None) -> Wanted:
    """How the robot wants commands on a topic: as `asked` for, as its nodes say, or as its image is known for.

    Raises `ConfigError` if they hear other types than what is asked for.
    """
    name = place.full(topic)
    hashes = heard_commands(sight, place.domain, name)
    words = sorted(CMD_VEL_WORD[kind] for kind in hashes)
    if asked and words and asked not in words:
        raise ConfigError(f"the robot listens to no {asked} on '{name}'", f"Say --cmd-vel {words[0]}.")
    usual = "twist_stamped" if image is not None and image.stamped else "twist"
    word = asked or (words[-1] if words else usual)  # of both, the one with a stamp
    return Wanted(word == "twist_stamped", hashes)
