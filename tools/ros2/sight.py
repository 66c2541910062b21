"""What somebody sees at an address, sorted by the form in which it is there, and the words that drive it. Pure."""

import contextlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from lira.hal.bus.sensors import SENSORS
from lira.hal.bus.topics import ESTOP_PRESS, Topic
from lira.hal.errors import CodecError
from lira.hal.messages import Twist, TwistStamped
from lira.hal.messages.ros.codec import decode, ros_type_of
from lira.hal.rmw.tokens import Kind
from lira.hal.ros_graph.look import OURS, Heard, Sight

TWIST, STAMPED = ros_type_of(Twist), ros_type_of(TwistStamped)
COMMANDED = "cmd_vel"
CMD_VEL_WORD = {TWIST: "twist", STAMPED: "twist_stamped"}
NEEDED = ("scan", "camera")
NAMED: dict[str, Topic[Any]] = {each.name: each.topic for each in SENSORS if not each.many and each.name != "depth"}
Names = dict[str, str]  # type of ROS 2 by topic, without its first slash


@dataclass(frozen=True, slots=True)
class Place:
    """One form in which topics are there: `domain` of rmw_zenoh, None behind a bridge. `robot`: ours, of that name."""

    domain: int | None = None
    robot: str = ""


@dataclass(slots=True)
class Found:
    """What is at one place: said and heard by nodes there by their tokens, and what came."""

    said: Names = field(default_factory=dict)
    commanded: Names = field(default_factory=dict)
    came: dict[str, Heard] = field(default_factory=dict)

    @property
    def topics(self) -> Names:
        """All that is said, as far as its type is known."""
        return {name: kind for name, heard in self.came.items() if (kind := heard.ros_type)} | self.said


def sort(sight: Sight) -> dict[Place, Found]:
    """Sort what was seen by its places."""
    found: dict[Place, Found] = {}
    ours = _ours(sight)
    for endpoint in sight.endpoints:
        _note(found, Place(endpoint.node.domain), endpoint.kind, endpoint.name.strip("/"), endpoint.ros_type)
    for route in sight.routes:
        robot, _, name = route.key.partition("/")
        place, name = (Place(robot=robot), name) if robot in ours else (Place(), route.key)
        _note(found, place, route.kind, name, route.ros_type)
    for heard in sight.heard:
        place, name = _place(heard)
        there = found.setdefault(place, Found())
        there.came[name] = heard
        if not heard.ros_type and name not in there.said and (kind := guess(heard.sample)):
            there.said[name] = kind
    return found


def _ours(sight: Sight) -> set[str]:
    """Robots of ours: by what they send, and by the service that only they announce; to a bridge they say the rest."""
    services = {route.key.partition("/")[::2] for route in sight.routes if route.kind is Kind.SERVICE}
    told = {robot for robot, name in services if name == ESTOP_PRESS}
    return told | {heard.key.partition("/")[0] for heard in sight.heard if heard.attached == OURS}


def guess(payload: bytes) -> str:
    """Name the type of a sensor's message by what it can be decoded as; "" if that is none or several."""
    fits = []
    for topic in {each.topic.kind: each.topic for each in SENSORS}.values():
        with contextlib.suppress(CodecError):
            decode(topic.kind, payload)
            fits.append(topic.ros_type)
    return fits[0] if len(fits) == 1 else ""


def words(place: Place, there: Found, address: str) -> list[str]:
    """Return the words for the command line that drive what is there."""
    if place.robot:
        return ["lira", "drive", "lidar-expert", *_connect(address), "--name", place.robot]
    names = choose(there)
    namespace = _namespace(names)
    line = ["lira", "ros2", *([] if place.domain is None else ["--rmw"]), *_connect(address)]
    if place.domain:
        line += ["--domain", str(place.domain)]
    if namespace:
        line += ["--namespace", namespace]
    kind = there.commanded.get(names.get(COMMANDED, ""), "")
    if kind:
        line += ["--cmd-vel", CMD_VEL_WORD[kind]]
    for name, topic in names.items():
        inside = topic.removeprefix(f"{namespace}/") if namespace else topic
        if inside != _usual(name):
            line += ["--topic", f"{name}={inside}"]
    return line


def heard_commands(sight: Sight, domain: int | None, name: str) -> dict[str, str]:
    """The types of velocity that nodes listen to on one topic, each with its hash ("" behind a bridge)."""
    if domain is None:
        found = [
            (route.ros_type, "") for route in sight.routes if route.kind is Kind.SUBSCRIPTION and route.key == name
        ]
    else:
        found = [
            (each.ros_type, each.type_hash)
            for each in sight.endpoints
            if (each.kind, each.node.domain, each.name.strip("/")) == (Kind.SUBSCRIPTION, domain, name)
        ]
    return {kind: type_hash for kind, type_hash in found if kind in CMD_VEL_WORD}


def lacking(place: Place, there: Found) -> list[str]:
    """Say what it would need to be driven, each with what to do."""
    if place.robot:
        return []
    names, found = choose(there), []
    for name in (each for each in NEEDED if each not in names):
        found.append(f"no {name} ({NAMED[name].ros_type}): it is not driven without one")
    if COMMANDED not in names:
        found.append(f"nobody says that it listens to {TWIST} or TwistStamped: is its controller running?")
    return found


def choose(there: Found) -> dict[str, str]:
    """Choose a topic for each sensor and for the command: by its type, then its usual name, then the shortest."""
    chosen = {}
    for name, topic in NAMED.items():
        fits = [each for each, kind in there.topics.items() if kind == topic.ros_type]
        if name == "camera":
            fits = [each for each in fits if "depth" not in each.lower()]
        if fits:
            chosen[name] = _best(fits, topic.key)
    listening = [each for each, kind in there.commanded.items() if kind in CMD_VEL_WORD]
    if listening:
        chosen[COMMANDED] = _best(listening, COMMANDED)
    return chosen


def _best(names: Iterable[str], usual: str) -> str:
    return min(names, key=lambda name: (f"/{name}".endswith(f"/{usual}") is False, len(name), name))


def _namespace(names: dict[str, str]) -> str:
    """Where most have their usual name, if all the others lie there as well; "" otherwise."""
    votes = [topic.removesuffix(_usual(name)).strip("/") for name, topic in names.items()]
    votes = [
        vote for name, vote in zip(names, votes, strict=True) if f"{vote}/{_usual(name)}".strip("/") == names[name]
    ]
    best = max(votes, key=votes.count, default="")
    return best if all(topic.startswith(f"{best}/") for topic in names.values()) else ""


def _usual(name: str) -> str:
    return COMMANDED if name == COMMANDED else NAMED[name].key


def _connect(address: str) -> list[str]:
    return ["--connect", address]


def _place(heard: Heard) -> tuple[Place, str]:
    if heard.rmw is not None:
        return Place(heard.rmw.domain), heard.rmw.topic
    if heard.attached == OURS:
        robot, _, name = heard.key.partition("/")
        return Place(robot=robot), name
    return Place(), heard.key


def _note(found: dict[Place, Found], place: Place, kind: Kind, name: str, ros_type: str) -> None:
    there = found.setdefault(place, Found())
    if kind is Kind.PUBLISHER:
        there.said[name] = ros_type
    elif kind is Kind.SUBSCRIPTION:
        there.commanded[name] = ros_type
