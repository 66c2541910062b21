"""How a recording lies on disk, and what is written into it beside the messages.

A recording is a folder like that of rosbag2: `NAME_0.mcap`, `NAME_1.mcap`, ... and `metadata.yaml`. Each file is of
MCAP's profile ros2: topics with their ROS types and definitions, payloads in CDR as they travelled. What rode beside a
message (`hal.bus.attachment`) stands before it on a topic of its own, so that it can be sent again as it was.
"""

import re
from pathlib import Path

import msgspec

from lira.hal.bus.services import LOCKSTEP, Info
from lira.hal.errors import StorageError

FOLDER = "recording"  # in that of a run
SUFFIX = ".mcap"
BAG = "metadata.yaml"
PROFILE, ENCODING, SCHEMA_ENCODING = "ros2", "cdr", "ros2msg"
ATTACHMENT_KEY, ATTACHMENT_TYPE = "lira/attachment", "lira_msgs/msg/Attachment"
HEAD, LOSSES = "lira.recording", "lira.losses"  # names of MCAP metadata
INFO = "info.json"  # name of an MCAP attachment


class Head(msgspec.Struct, frozen=True):
    """What a recording is of.

    `offset_ns` is what was added to times on the robot's clock, and `began_ns` when it began, both for nanoseconds of
    Unix time. `info` is what the robot said about itself. `part` counts the files of one recording.
    """

    robot: str
    version: str
    offset_ns: int
    began_ns: int
    info: Info
    command: str = ""
    part: int = 0

    @property
    def lockstep(self) -> bool:
        """Whether the robot's time waited for whoever drove."""
        return self.info.mode == LOCKSTEP

    @property
    def world(self) -> str:
        """Name of the twin's world, "" on a floor."""
        return _World.name_in(self.info.arena)

    @property
    def began_s(self) -> float:
        """When it began, on the robot's clock."""
        return self.to_robot_s(self.began_ns)

    def to_robot_s(self, time_ns: int) -> float:
        """Return a time of the file on the robot's clock."""
        return (time_ns - self.offset_ns) / 1e9

    def to_metadata(self) -> dict[str, str]:
        """All of it but `info`, as MCAP has metadata."""
        return {
            "robot": self.robot,
            "version": self.version,
            "offset_ns": str(self.offset_ns),
            "began_ns": str(self.began_ns),
            "command": self.command,
            "part": str(self.part),
        }


class _World(msgspec.Struct):
    name: str = ""

    @classmethod
    def name_in(cls, arena: bytes) -> str:
        found = msgspec.json.decode(bytes(arena), type=cls | None)
        return "" if found is None else found.name


def head_from(metadata: dict[str, str], info: bytes) -> Head:
    """Read what `Head.to_metadata` and `Info.to_json` wrote. Raises `StorageError`."""
    try:
        return msgspec.convert({**metadata, "info": msgspec.json.decode(info, type=Info)}, Head, strict=False)
    except (msgspec.MsgspecError, ValueError) as error:
        raise StorageError(f"the recording's head is not understood: {error}", "Is it of another version?") from error


def files_of(path: Path) -> list[Path]:
    """Return the files of a recording in order: of a single one, of its folder, or of the folder of a run: then
    those of its last day.

    Raises `StorageError` if there is none.
    """
    if path.is_file():
        return [path]
    newest = sorted(path.glob(f"{FOLDER}*"), key=lambda folder: _count(folder.name), reverse=True)
    for folder in (path, *newest):
        found = sorted(folder.glob(f"*{SUFFIX}"), key=lambda file: _count(file.stem))
        if found:
            return found
    raise StorageError(f"there is no recording at {path}", f"Name a {SUFFIX} file, or the folder of a run.")


def _count(name: str) -> tuple[str, int]:
    """Split what ends in a number, so that 10 comes after 9."""
    number = re.search(r"[-_](\d+)$", name)
    return (name, 0) if number is None else (name[: number.start()], int(number[1]))
