"""What rosbag2 reads beside MCAP files: `metadata.yaml`. YAML takes JSON as it is, so that is what is written."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec

from lira.hal.messages.ros.types import types_with
from lira.tools.recording.layout import BAG, ENCODING, Head

VERSION = 9
DISTRO = "jazzy"  # whose message definitions `hal.messages` has
FOREVER = {"sec": 9223372036, "nsec": 854775807}


@dataclass(slots=True)
class BagFile:
    """One file's part of it. `topics` are counts by name, type and whether the last value was kept for late readers."""

    path: Path
    first_ns: int = 0
    last_ns: int = 0
    topics: dict[tuple[str, str, bool], int] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """How many messages there are in it."""
        return sum(self.topics.values())

    def note(self, topic: str, ros_type: str, log_ns: int, *, latched: bool) -> None:
        """Count a message."""
        if not self.topics:
            self.first_ns = self.last_ns = log_ns
        self.first_ns, self.last_ns = min(self.first_ns, log_ns), max(self.last_ns, log_ns)
        key = topic, ros_type, latched
        self.topics[key] = self.topics.get(key, 0) + 1


def qos_of(*, latched: bool) -> list[dict[str, Any]]:
    """How a topic was offered, as rosbag2 says it since version 9."""
    return [
        {
            "history": "keep_last",
            "depth": 1 if latched else 10,
            "reliability": "reliable",
            "durability": "transient_local" if latched else "volatile",
            "deadline": FOREVER,
            "lifespan": FOREVER,
            "liveliness": "automatic",
            "liveliness_lease_duration": FOREVER,
            "avoid_ros_namespace_conventions": False,
        }
    ]


def qos_text(*, latched: bool) -> str:
    """The same for a channel's metadata in MCAP."""
    return msgspec.json.encode(qos_of(latched=latched)).decode()


def write_bag(folder: Path, files: Sequence[BagFile], head: Head) -> None:
    """Write `metadata.yaml`, whole or not at all."""
    filled = [each for each in files if each.topics]
    first_ns = min((each.first_ns for each in filled), default=head.began_ns)
    last_ns = max((each.last_ns for each in filled), default=head.began_ns)
    counts: dict[tuple[str, str, bool], int] = {}
    for each in files:
        for key, count in each.topics.items():
            counts[key] = counts.get(key, 0) + count
    about = {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": last_ns - first_ns},
        "starting_time": {"nanoseconds_since_epoch": first_ns},
        "message_count": sum(counts.values()),
        "topics_with_message_count": [_topic(*key, count) for key, count in sorted(counts.items())],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [each.path.name for each in files],
        "files": [
            {
                "path": each.path.name,
                "starting_time": {"nanoseconds_since_epoch": each.first_ns or head.began_ns},
                "duration": {"nanoseconds": each.last_ns - each.first_ns},
                "message_count": each.count,
            }
            for each in files
        ],
        "custom_data": head.to_metadata(),
        "ros_distro": DISTRO,
    }
    text = msgspec.json.format(msgspec.json.encode({"rosbag2_bagfile_information": about}), indent=2)
    passing = folder / f"{BAG}.tmp"
    passing.write_bytes(text + b"\n")
    passing.replace(folder / BAG)


def _topic(name: str, ros_type: str, latched: bool, count: int) -> dict[str, Any]:
    types = types_with(ros_type)
    return {
        "topic_metadata": {
            "name": name,
            "type": ros_type,
            "serialization_format": ENCODING,
            "offered_qos_profiles": qos_of(latched=latched),
            "type_description_hash": types.hash_rihs01(ros_type) if types is not None else "",
        },
        "message_count": count,
    }
