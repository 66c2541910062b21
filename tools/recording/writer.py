"""Writes messages into the files of a recording, a new one whenever the last is large enough."""

import contextlib
import struct
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

import msgspec
from mcap.writer import CompressionType, Writer

from lira.hal.bus.reader import RawSample
from lira.hal.bus.topics import LATCHED_KEYS
from lira.hal.errors import StorageError
from lira.hal.messages.ros.types import definition
from lira.tools.recording.bag import BagFile, qos_text, write_bag
from lira.tools.recording.layout import (
    ATTACHMENT_KEY,
    ATTACHMENT_TYPE,
    ENCODING,
    HEAD,
    INFO,
    LOSSES,
    PROFILE,
    SCHEMA_ENCODING,
    SUFFIX,
    Head,
)

CHUNK_BYTES = 256 * 2**10
SEQUENCES = 2**32
_CDR_HEADER = b"\0\1\0\0"


class RecordingWriter:
    """Writes one recording. `head` says of what; a file takes up to `split_bytes`.

    What was added is in the system's hands after `flush`: from there it is lost with the machine only, not with the
    process. Raises `StorageError` if there is a recording already, and whatever `OSError` the disk has.
    """

    def __init__(self, folder: Path, head: Head, *, split_bytes: int) -> None:
        if list(folder.glob(f"*{SUFFIX}")):
            raise StorageError(f"{folder} already holds a recording", "Choose another folder.")
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self._head, self._split_bytes = folder, head, split_bytes
        self._bag: list[BagFile] = []
        self._open()

    @property
    def files(self) -> int:
        """How many files there are."""
        return len(self._bag)

    @property
    def size_bytes(self) -> int:
        """Size of all files; what waits to be written is not counted."""
        return sum(each.path.stat().st_size for each in self._bag)

    def add(self, sample: RawSample, log_ns: int, publish_ns: int, sequence: int = 0) -> None:
        """Add a message. Times are nanoseconds of Unix time; `sequence` is cut to what MCAP has room for."""
        if sample.attachment is not None:
            beside = attachment_to_cdr(sample.key, sample.attachment)
            self._put(ATTACHMENT_KEY, ATTACHMENT_TYPE, beside, log_ns, publish_ns, sequence)
        self._put(sample.key, sample.ros_type, sample.payload, log_ns, publish_ns, sequence)
        if self._file.tell() > self._split_bytes:
            self._close()
            self._open()

    def note_losses(self, losses: dict[str, int], log_ns: int) -> None:
        """Write down how many messages were lost until now, by key."""
        self._writer.add_metadata(LOSSES, {"log_ns": str(log_ns), **{key: str(count) for key, count in losses.items()}})

    def flush(self) -> None:
        """Hand all that was added to the system."""
        self._writer.flush()

    def close(self) -> None:
        """Write the index, and what rosbag2 reads beside the files."""
        self._close()
        write_bag(self.folder, self._bag, self._head)

    def abandon(self) -> None:
        """Let go of the files as they are: what was flushed can be read, and recovered."""
        with contextlib.suppress(OSError):
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, OSError):
            self.abandon()
        else:
            self.close()

    def _open(self) -> None:
        number = len(self._bag)
        path = self.folder / f"{self.folder.name}_{number}{SUFFIX}"
        self._file: BinaryIO = path.open("xb")
        self._now = BagFile(path)
        self._bag.append(self._now)
        self._channels: dict[tuple[str, str], int] = {}
        self._schemas: dict[str, int] = {"": 0}
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start(profile=PROFILE, library=f"lira-rosbot {self._head.version}; mcap")
        head = msgspec.structs.replace(self._head, part=number)
        self._writer.add_metadata(HEAD, head.to_metadata())
        self._writer.add_attachment(head.began_ns, head.began_ns, INFO, "application/json", head.info.to_json())
        self._file.flush()

    def _close(self) -> None:
        with self._file:
            self._writer.finish()

    def _put(self, key: str, ros_type: str, payload: bytes, log_ns: int, publish_ns: int, sequence: int) -> None:
        topic = f"/{self._head.robot}/{key}"
        channel = self._channels.get((key, ros_type)) or self._channel(topic, key, ros_type)
        self._writer.add_message(channel, log_ns, payload, publish_ns, sequence % SEQUENCES)
        self._now.note(topic, ros_type, log_ns, latched=key in LATCHED_KEYS)

    def _channel(self, topic: str, key: str, ros_type: str) -> int:
        schema = self._schemas.get(ros_type)
        if schema is None:
            # Of what nobody here knows only the name is kept.
            schema = self._writer.register_schema(ros_type, SCHEMA_ENCODING, definition(ros_type).encode())
            self._schemas[ros_type] = schema
        about = {"offered_qos_profiles": qos_text(latched=key in LATCHED_KEYS)}
        channel = self._writer.register_channel(topic, ENCODING, schema, about)
        self._channels[key, ros_type] = channel
        return channel


def attachment_to_cdr(key: str, data: bytes) -> bytes:
    """Serialise `lira_msgs/Attachment`: quicker than the general way, and there is one for nearly every message."""
    name = key.encode() + b"\0"
    pad = -(4 + len(name)) % 4
    return b"".join((_CDR_HEADER, struct.pack("<I", len(name)), name, b"\0" * pad, struct.pack("<I", len(data)), data))


def attachment_from_cdr(cdr: bytes) -> tuple[str, bytes]:
    """Inverse of `attachment_to_cdr`. Raises `ValueError` or `struct.error` for what is none."""
    (size,) = struct.unpack_from("<I", cdr, 4)
    at = 8 + size + -(4 + size) % 4
    (length,) = struct.unpack_from("<I", cdr, at)
    return cdr[8 : 8 + size - 1].decode(), cdr[at + 4 : at + 4 + length]
