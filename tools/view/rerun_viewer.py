"""Rerun: its viewer, started beside, or a file of its own for later."""

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rb

from lira.hal.bus.topics import DESCRIPTION
from lira.hal.errors import ConfigError, StorageError
from lira.hal.messages.description import ODOM_FRAME
from lira.tools.view.rerun_entities import ENTITIES
from lira.tools.view.source import Sample

TIME = "heard"  # name of the time line


class RerunViewer:
    """Shows a robot in Rerun's viewer, or writes `file` (.rrd). Raises `ConfigError` or `StorageError` if it cannot."""

    def __init__(self, robot: str, file: Path | None = None) -> None:
        self._stream = rr.RecordingStream(f"lira {robot}")
        try:
            if file is None:
                self._stream.spawn(default_blueprint=blueprint(), hide_welcome_screen=True)
            else:
                with file.open("xb"):
                    self._stream.save(file, default_blueprint=blueprint())
        except OSError as error:
            raise StorageError(f"cannot write {file}: {error.strerror}", "Choose another file.") from error
        except RuntimeError as error:
            raise ConfigError(f"Rerun's viewer does not start: {error}", "Write a file with --rerun FILE.") from error
        self._described = ""

    def wanted(self) -> Collection[str]:
        """Everything that it shows."""
        return (*ENTITIES, DESCRIPTION.key)

    def show(self, samples: Sequence[Sample]) -> None:
        """Log samples."""
        for sample in samples:
            self._stream.set_time(TIME, timestamp=np.datetime64(sample.time_ns, "ns"))
            if sample.topic.key == DESCRIPTION.key:
                self._describe(sample.message.data)
                continue
            for path, told in ENTITIES[sample.topic.key](sample.message):
                self._stream.log(path, told)

    def close(self) -> None:
        """Hand over what is left."""
        self._stream.disconnect()

    def _describe(self, urdf: str) -> None:
        """Show the model, with the frames that are fixed to it; once, though it may be told again."""
        if urdf != self._described:
            self._described = urdf
            self._stream.log_file_from_contents("robot.urdf", urdf.encode(), entity_path_prefix="robot", static=True)


def blueprint() -> rb.Blueprint:
    """How it is laid out: the robot in space and its camera, beside who drives, why, and how much."""
    return rb.Blueprint(
        rb.Horizontal(
            rb.Vertical(
                rb.Spatial3DView(
                    name="Robot",
                    contents=["robot/**", "world/**"],
                    spatial_information=rb.SpatialInformation(target_frame=ODOM_FRAME),
                ),
                rb.Spatial2DView(name="Camera", origin="world/camera"),
                row_shares=[3, 2],
            ),
            rb.Vertical(
                rb.StateTimelineView(name="Who drives, and why", origin="who"),
                rb.TimeSeriesView(name="Activations", origin="activation"),
                rb.TimeSeriesView(name="Turn: executed, novice, human, experts", origin="action/angular"),
                rb.TimeSeriesView(name="Speed", origin="speed"),
                rb.TimeSeriesView(name="Learning", origin="learning"),
            ),
        ),
        rb.TimePanel(state="collapsed"),
    )
