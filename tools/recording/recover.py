"""Mends recordings that were cut off: what is whole of them gets an index again, and rosbag2's metadata."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mcap.records import Attachment, Channel, Footer, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

from lira.hal.bus.topics import LATCHED_KEYS
from lira.hal.words import plural
from lira.tools.recording.bag import BagFile, write_bag
from lira.tools.recording.layout import ATTACHMENT_KEY, BAG, PROFILE, files_of
from lira.tools.recording.reader import Recording
from lira.tools.recording.writer import CHUNK_BYTES


def recover(path: Path) -> Iterator[str]:
    """Mend every file of a recording that needs it, in place; yield a line for each. Raises `StorageError`."""
    files = files_of(path)
    bag = []
    for each in files:
        recording = Recording(each)
        records = list(recording.records(each)) if _is_torn(recording, each) else None
        if records is not None:
            _rewrite(each, records, recording.head.version)
        found = BagFile(each)
        for topic, ros_type, log_ns in _messages(Recording(each), each):
            latched = topic.removeprefix(f"/{recording.head.robot}/") in LATCHED_KEYS
            found.note(topic, ros_type, log_ns, latched=latched)
        bag.append(found)
        yield f"{each}: {'whole' if records is None else 'mended'}, {plural(_heard(found), 'message')}"
    if path.is_dir():
        write_bag(files[0].parent, bag, Recording(files[0]).head)
        yield f"{files[0].parent / BAG} written"


def _heard(file: BagFile) -> int:
    """How many messages were heard; what rode beside them is none, although others read it as a topic."""
    return sum(count for (topic, _, _), count in file.topics.items() if not topic.endswith(f"/{ATTACHMENT_KEY}"))


def _is_torn(recording: Recording, path: Path) -> bool:
    last: Any = None
    for last in recording.records(path):  # noqa: B007 - only the last counts
        pass
    return bool(recording.torn) or not isinstance(last, Footer)


def _messages(recording: Recording, path: Path) -> Iterator[tuple[str, str, int]]:
    """Yield the topic, type and time of every message, as others read the file."""
    schemas: dict[int, str] = {0: ""}
    channels: dict[int, tuple[str, str]] = {}
    for record in recording.records(path):
        match record:
            case Schema():
                schemas[record.id] = record.name
            case Channel():
                channels[record.id] = record.topic, schemas[record.schema_id]
            case Message():
                yield *channels[record.channel_id], record.log_time


def _rewrite(path: Path, records: list[Any], version: str) -> None:
    passing = path.with_suffix(".recovered")
    schemas, channels = {0: 0}, {}
    with passing.open("wb") as file:
        writer = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        writer.start(profile=PROFILE, library=f"lira-rosbot {version}; mcap")
        for record in records:
            match record:
                case Metadata():
                    writer.add_metadata(record.name, record.metadata)
                case Attachment():
                    times = record.create_time, record.log_time
                    writer.add_attachment(*times, record.name, record.media_type, record.data)
                case Schema() if record.id not in schemas:
                    schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                case Channel() if record.id not in channels:
                    kept = record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
                    channels[record.id] = writer.register_channel(*kept)
                case Message():
                    times = record.log_time, record.publish_time
                    writer.add_message(channels[record.channel_id], times[0], record.data, times[1], record.sequence)
        writer.finish()
    passing.replace(path)
