"""The messages of a recording as viewers want them."""

from collections.abc import Iterator
from pathlib import Path

from lira.hal.errors import CodecError
from lira.tools.recording.reader import Recording, topic_of
from lira.tools.view.source import Sample


def samples_of(recording: Recording) -> Iterator[Sample]:
    """Yield everything in it that is of a topic of ours and can be read."""
    for each in recording.messages():
        topic = topic_of(each.key)
        if topic is None or topic.ros_type != each.ros_type:
            continue
        try:
            yield Sample(topic, each.message, each.payload, each.log_ns)
        except CodecError:
            continue


def open_recording(path: Path) -> tuple[str, Iterator[Sample]]:
    """Return the name of the robot that a recording is of, and its samples. Raises `StorageError`."""
    recording = Recording(path)
    return recording.head.robot, samples_of(recording)
