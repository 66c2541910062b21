"""A bag of ROS 1 or 2 as demonstrations: at the robot's control rate, what was sensed and what was commanded.

The topics are found by their types: one scan, one picture, one command. A bag's own clock is the one that counts.
"""

import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader, AnyReaderError

from lira.fusion.control import to_action
from lira.fusion.learning.labels import is_rest
from lira.fusion.preprocess import Preprocessor
from lira.hal.bus.sensors import Stamped, observation_of
from lira.hal.errors import ConfigError, SensorError, StorageError
from lira.hal.messages import Applied, CompressedImage, Image, LaserScan, Source, Twist, TwistStamped
from lira.hal.messages.bounds import check
from lira.hal.messages.ros.codec import CODECS, ros_type_of
from lira.hal.messages.ros.types import all_types
from lira.hal.profile import RobotProfile
from lira.tools.export.demonstrations import Shown

METADATA = "metadata.yaml"  # of a bag of ROS 2; one of ROS 1 is a file
REMEDY = "Give the folder of a bag, or of a LeRobot data set."
Heard = tuple[float, str, Any]  # when, for what, and which message
BREAK_S = 2.0  # of silence: the next episode
ROLES: dict[str, tuple[type, ...]] = {
    "scan": (LaserScan,),
    "camera": (CompressedImage, Image),
    "command": (Twist, TwistStamped, Applied),
}
# What reading a message raises that is none of its type.
MALFORMED = (AnyReaderError, struct.error, ValueError, TypeError, LookupError, AttributeError, AssertionError)


@dataclass(frozen=True, slots=True)
class Chosen:
    """A topic of a bag, what it is for, and what its messages are here."""

    topic: str
    role: str
    kind: type


def read_bag(path: Path, profile: RobotProfile, topics: Mapping[str, str]) -> Iterator[Shown]:
    """Yield what was shown; `topics` names those for `scan`, `camera` and `command` where a type has several.

    Where nobody drove, or a sensor that the robot learns from is silent or useless, nothing is yielded.
    Raises `StorageError` for what is no bag, `ConfigError` if it is not clear which topic is meant.
    """
    if not path.exists():
        raise StorageError(f"there is no {path}", REMEDY)
    if path.is_dir() and not (path / METADATA).exists():
        raise StorageError(f"{path} is neither a bag nor a LeRobot data set", REMEDY)
    try:
        with AnyReader([path], default_typestore=all_types()) as bag:
            chosen = choose({each.topic: each.msgtype for each in bag.connections}, topics)
            yield from shown_by(_values(bag, {each.topic: each for each in chosen}), profile)
    except (AnyReaderError, OSError) as error:
        raise StorageError(f"{path} is no bag that can be read: {error}", REMEDY) from error


def _values(bag: AnyReader, chosen: Mapping[str, Chosen]) -> Iterator[Heard]:
    """Yield what can be read of the topics that were chosen."""
    for connection, time_ns, data in bag.messages([each for each in bag.connections if each.topic in chosen]):
        each = chosen[connection.topic]
        try:
            value = CODECS[each.kind].from_ros(bag.deserialize(data, connection.msgtype))
            check(value)
        except MALFORMED:
            continue
        yield time_ns / 1e9, each.role, value


def choose(types: Mapping[str, str], named: Mapping[str, str]) -> tuple[Chosen, ...]:
    """Return the topics of each role, of a bag with topics of these types. Raises `ConfigError`. Pure."""
    return tuple(found for role in ROLES if (found := _chosen(role, types, named.get(role))) is not None)


def _chosen(role: str, types: Mapping[str, str], named: str | None) -> Chosen | None:
    kinds = {ros_type_of(kind): kind for kind in ROLES[role]}
    fitting = {topic: kinds[name] for topic, name in sorted(types.items()) if name in kinds}
    if named is not None:
        if named not in fitting:
            raise ConfigError(
                f"no topic '{named}' of the bag is a {role}", f"There are: {', '.join(fitting) or 'none'}."
            )
        return Chosen(named, role, fitting[named])
    if len(fitting) > 1:
        raise ConfigError(f"the bag has several for {role}", f"Choose one with --{role}: {', '.join(fitting)}.")
    if role == "command" and not fitting:
        wanted = ", ".join(kinds)
        raise ConfigError("nobody commands anything in the bag", f"It needs a topic of one of the types {wanted}.")
    return next((Chosen(topic, role, kind) for topic, kind in fitting.items()), None)


def shown_by(heard: Iterable[Heard], profile: RobotProfile) -> Iterator[Shown]:
    """Yield what was shown, by what was measured and commanded, in order. Pure."""
    preprocess, newest = Preprocessor(profile), dict[str, Stamped]()
    due_s, last_s, episode, number = 0.0, float("-inf"), 0, 0
    for now_s, role, value in heard:
        if role != "command":
            newest[role] = replace(_as_rgb(value), stamp_s=now_s)
            continue
        twist = _twist(value)
        if twist is None or is_rest(action := to_action(twist, profile.base)):
            continue
        if now_s - last_s > BREAK_S:
            episode, due_s = episode + 1, now_s
        last_s = now_s
        if now_s < due_s:
            continue
        due_s, number = max(due_s + profile.period_s, now_s), number + 1
        try:
            features = preprocess(observation_of(number, now_s, newest))
        except SensorError:
            continue
        if features is not None:
            yield Shown(now_s, episode, features, action)


def _as_rgb(value: Any) -> Any:
    """Many cameras of ROS have blue first."""
    if isinstance(value, Image) and value.encoding == "bgr8":
        return replace(value, data=value.data[..., ::-1], encoding="rgb8")
    return value


def _twist(command: Twist | TwistStamped | Applied) -> Twist | None:
    """What a person commanded; of what the wheels got only what came from a hand."""
    if isinstance(command, Twist):
        return command
    if isinstance(command, Applied) and command.source is not Source.TELEOP:
        return None
    return command.twist
