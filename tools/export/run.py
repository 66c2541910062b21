"""A recorded run as tables: what its recording holds, and what its log of labels knows of it."""

from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

from lira.fusion.log.label_log import read_demonstrations
from lira.hal.bus.topics import CAMERA, DEPTH, Topic
from lira.hal.errors import CodecError, StorageError
from lira.hal.messages import CompressedImage
from lira.tools.export.buffer import in_buffer
from lira.tools.export.columns import Table, tables_of
from lira.tools.export.pictures import Cameras, Pictures, color_pictures, depth_pictures
from lira.tools.export.steps import TOPICS, ExportStep, Heard, episodes_of, steps_of
from lira.tools.recording.layout import Head
from lira.tools.recording.reader import Recording
from lira.tools.runs.names import LABELS


class RecordedRun(NamedTuple):
    """`labels` is the log that says what was learned; without one the recording's own counts do."""

    head: Head
    tables: list[Table]
    cameras: Cameras
    labels: Path | None

    @property
    def fps(self) -> int:
        """Steps a second, as whole as others want it."""
        return max(1, round(self.head.info.profile.control.rate_hz))


def load_run(path: Path, labels: Path | None = None) -> RecordedRun:
    """Read a recording, or the folder of a run with one. Raises `StorageError`, also if nobody decided anything."""
    recording = Recording(path)
    log = labels or labels_beside(path)
    steps: Iterable[ExportStep] = steps_of(_readable(recording.messages(*TOPICS)))
    if log is not None:
        steps = in_buffer(steps, read_demonstrations(log))
    tables = tables_of(list(episodes_of(steps)), recording.head.info.profile)
    if not tables:
        raise StorageError(f"nobody decided anything in {path}", "Record while lira fusion or lira drive decides.")
    return RecordedRun(recording.head, tables, cameras_of(recording), log)


def cameras_of(recording: Recording) -> dict[str, Pictures]:
    """The pictures of each camera of which there are any."""
    profile = recording.head.info.profile
    found = {"camera": color_pictures(partial(_told, recording, CAMERA))}
    if profile.depth is not None:
        found["depth"] = depth_pictures(partial(_told, recording, DEPTH), profile)
    return {name: each for name, each in found.items() if each.size is not None}


def _told(recording: Recording, topic: Topic[CompressedImage]) -> Iterator[CompressedImage]:
    return (each.message for each in _readable(recording.messages(topic)))


def labels_beside(path: Path) -> Path | None:
    """Find the log of labels of the run that a recording belongs to."""
    whole = path.resolve()
    return next((log for folder in (whole, *whole.parents[:2]) if (log := folder / LABELS).is_file()), None)


def _readable(messages: Iterable[Heard]) -> Iterator[Heard]:
    """Leave out what cannot be read: it moved nobody then, either."""
    for each in messages:
        try:
            _ = each.message
        except CodecError:
            continue
        yield each
