"""Reads recordings: every message in the order in which it was recorded, decoded when it is looked at.

    recording = Recording(Path("runs/mine"))
    for each in recording.messages(SCAN, CAMERA):
        print(each.key, each.stamp_s, each.message)

A file that was cut off, by a kill or a full disk, is read as far as it is whole.
"""

import contextlib
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO

from mcap.exceptions import McapError
from mcap.records import Attachment as McapAttachment
from mcap.records import Channel, Chunk, Footer, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from zstandard import ZstdError

from lira.hal.bus.attachment import Attachment, parse_attachment
from lira.hal.bus.topics import BY, TOPICS, Topic, named
from lira.hal.errors import CodecError, StorageError
from lira.hal.messages.ros.codec import decode
from lira.hal.messages.ros.types import types_with
from lira.tools.recording.layout import ATTACHMENT_KEY, HEAD, INFO, LOSSES, Head, files_of, head_from
from lira.tools.recording.writer import attachment_from_cdr

# What reading a file raises that ends in the middle of something, or was never one.
TORN = (McapError, struct.error, ValueError, KeyError, EOFError, zlib.error, ZstdError, UnicodeDecodeError)
RECORD_BYTES = 64 * 2**20  # no record of ours is longer
_TOPICS = {topic.key: topic for topic in TOPICS}


@dataclass(frozen=True)
class Recorded:
    """One message. `key` lies below the robot's name; what rode beside it is in `beside`.

    `log_ns` is when it was recorded and `publish_ns` when it was sent, in nanoseconds of Unix time.
    """

    key: str
    ros_type: str
    payload: bytes = field(repr=False)
    beside: bytes | None = field(repr=False)
    log_ns: int
    publish_ns: int
    head: Head = field(repr=False)

    @cached_property
    def message(self) -> Any:
        """The message: one of `hal.messages` if its topic is in our table, else as the ROS type has it.

        Raises `CodecError` for what is none.
        """
        topic = topic_of(self.key)
        if topic is not None and topic.ros_type == self.ros_type:
            return decode(topic.kind, self.payload)
        types = types_with(self.ros_type)
        if types is None:
            raise CodecError(f"nobody here knows what a {self.ros_type or 'message without a type'} is")
        return types.deserialize_cdr(self.payload, self.ros_type)

    @cached_property
    def attachment(self) -> Attachment | None:
        """Who sent it, in which order and when; None for a ROS peer's."""
        return parse_attachment(self.beside)

    @property
    def stamp_s(self) -> float:
        """When it was measured or decided, on the robot's clock; when it was sent, for what carries no such time."""
        stamp_s = getattr(self.message, "stamp_s", None)
        return self.sent_s if stamp_s is None else float(stamp_s)

    @property
    def sent_s(self) -> float:
        """When it was sent, on the robot's clock."""
        return self.head.to_robot_s(self.publish_ns) if self.attachment is None else self.attachment.time_s

    @property
    def arrived_s(self) -> float:
        """When it was recorded, on the robot's clock."""
        return self.head.to_robot_s(self.log_ns)


def topic_of(key: str) -> Topic[Any] | None:
    """Return the row of the table for a key; with keys everybody commands on a key of their own."""
    plain, _, commander = key.partition(BY)
    topic = _TOPICS.get(plain)
    return topic if topic is None or not commander else named(topic, commander)


class Recording:
    """A recording: one file of it, its folder, or the folder of a run. Raises `StorageError` if there is none.

    `head` says of what. Once they were read, `torn` names the files that were cut off, and `losses` counts by key the
    messages that the recorder could not keep.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.files = files_of(path)
        self.torn: list[Path] = []
        self.losses: dict[str, int] = {}
        self._metadata: dict[str, str] = {}
        self._info = b""
        self.head = self._head()

    def messages(
        self, *topics: Topic[Any] | str, since_s: float = float("-inf"), until_s: float = float("inf")
    ) -> Iterator[Recorded]:
        """Yield messages in the order in which they were recorded, of some topics or keys only if any are named.

        `since_s` and `until_s` bound when they were recorded, on the robot's clock.
        """
        wanted = {topic if isinstance(topic, str) else topic.key for topic in topics}
        bounds = since_s, until_s
        for path in self.files:
            yield from self._messages(path, wanted, bounds)

    def _messages(self, path: Path, wanted: set[str], bounds: tuple[float, float]) -> Iterator[Recorded]:
        schemas: dict[int, str] = {0: ""}
        channels: dict[int, tuple[str, str]] = {}
        beside: tuple[str, bytes] | None = None
        skip = len(self.head.robot) + 2
        for record in self.records(path, *bounds):
            match record:
                case Message():
                    key, ros_type = channels[record.channel_id]
                    if key == ATTACHMENT_KEY:
                        beside = attachment_from_cdr(record.data)
                        continue
                    own = beside[1] if beside is not None and beside[0] == key else None
                    beside = None
                    if (wanted and key.partition(BY)[0] not in wanted) or not self._within(record.log_time, bounds):
                        continue
                    times = record.log_time, record.publish_time
                    yield Recorded(key, ros_type, record.data, own, *times, self.head)
                case Schema():
                    schemas[record.id] = record.name
                case Channel():
                    channels[record.id] = record.topic[skip:], schemas[record.schema_id]

    def _within(self, log_ns: int, bounds: tuple[float, float]) -> bool:
        return bounds[0] <= self.head.to_robot_s(log_ns) <= bounds[1]

    def records(self, path: Path, since_s: float = float("-inf"), until_s: float = float("inf")) -> Iterator[Any]:
        """Yield MCAP's records of a file, as far as it is whole; no messages of chunks that are out of bounds."""
        for record in self._outer(path):
            if not isinstance(record, Chunk):
                yield record
                continue
            first_s, last_s = map(self.head.to_robot_s, (record.message_start_time, record.message_end_time))
            try:
                found = breakup_chunk(record, validate_crc=True)
            except TORN:
                self._note_torn(path)
                return
            apart = first_s > until_s or last_s < since_s
            yield from (each for each in found if not (apart and isinstance(each, Message)))

    def _outer(self, path: Path) -> Iterator[Any]:
        with opened(path) as file:
            records = StreamReader(file, emit_chunks=True, record_size_limit=RECORD_BYTES).records
            while True:
                try:
                    record = next(records)
                except StopIteration:
                    return
                except TORN:
                    self._note_torn(path)
                    return
                self._note(record)
                yield record
                if isinstance(record, Footer):
                    return

    def _note(self, record: Any) -> None:
        if isinstance(record, Metadata) and record.name == HEAD:
            self._metadata = dict(record.metadata)
        elif isinstance(record, Metadata) and record.name == LOSSES:
            found = {key: int(count) for key, count in record.metadata.items() if key != "log_ns"}
            self.losses = {key: max(count, self.losses.get(key, 0)) for key, count in {**self.losses, **found}.items()}
        elif isinstance(record, McapAttachment) and record.name == INFO:
            self._info = record.data

    def _note_torn(self, path: Path) -> None:
        if path not in self.torn:
            self.torn.append(path)

    def _head(self) -> Head:
        for _ in self._outer(self.files[0]):
            if self._metadata and self._info:
                self.torn.clear()
                return head_from(self._metadata, self._info)
        raise StorageError(f"{self.files[0]} is no recording of a robot's bus", "Was it made by lira record?")


@contextlib.contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """Open a file to read. Raises `StorageError`."""
    try:
        file = path.open("rb")
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}", "Check the path and its permissions.") from error
    with file:
        yield file
