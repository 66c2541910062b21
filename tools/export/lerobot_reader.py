"""A LeRobotDataset v3 as demonstrations: each frame's picture, scan and action.

`scan` is a feature with as many numbers as the robot's networks see directions, in [0, 1]; `image` a video or pictures;
`action` two numbers, linear and angular, in fractions of the robot's limits. What `lira export lerobot` wrote fits.
"""

from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

import av
import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from lira.fusion.modalities.image import gray_image
from lira.fusion.preprocess import Features, modalities_of
from lira.hal.errors import ConfigError, StorageError
from lira.hal.messages import ByteArray, CompressedImage, Driver, FloatArray, Image
from lira.hal.profile import RobotProfile
from lira.tools.export.columns import SCAN
from lira.tools.export.demonstrations import Shown

Frames = Literal["all", "interventions", "buffer"]
CHOSEN_BY = {"interventions": "intervention", "buffer": "in_buffer"}
PICTURES = ("video", "image")
# What reading a data set raises that is damaged, or does not keep to its own description.
MALFORMED = (OSError, pa.ArrowException, av.FFmpegError, LookupError, ValueError, TypeError, AttributeError)
EARLY_S = 1e-3  # a frame's time is rounded


class Feature(msgspec.Struct):
    """What `info.json` says of a feature."""

    dtype: str
    shape: list[int]


class Info(msgspec.Struct):
    """What is needed of `meta/info.json`."""

    codebase_version: str
    fps: float
    data_path: str
    features: dict[str, Feature]
    video_path: str | None = None


def read_lerobot(
    folder: Path, profile: RobotProfile, frames: Frames | None = None, named: Mapping[str, str] | None = None
) -> Iterator[Shown]:
    """Yield what was shown in a folder, episode by episode.

    `frames` chooses which (default: a person's if the data set says which those are, else all), `named` the features
    for `image`, `scan` or `depth` where their names do not tell. Raises `StorageError` and `ConfigError`.
    """
    info = read_info(folder)
    sources = features_for(info, profile, named or {})
    try:
        for episode in _episodes(folder):
            rows = _rows(folder, info, episode)
            chosen = _chosen(rows, frames)
            pictures = {
                name: _pictures(folder, info, episode, key)
                for name, key in sources.items()
                if info.features[key].dtype == "video"
            }
            for number, row in enumerate(rows.to_pylist()):
                shown = {name: next(each, None) for name, each in pictures.items()}
                if chosen[number]:
                    yield _shown(row, int(episode["episode_index"]), sources, shown, profile)
    except MALFORMED as error:
        raise StorageError(f"{folder} cannot be read: {error}", "Is the data set whole?") from error


def read_info(folder: Path) -> Info:
    """Read `meta/info.json`. Raises `StorageError`, also for a data set of another version."""
    try:
        info = msgspec.json.decode((folder / "meta/info.json").read_bytes(), type=Info)
    except (OSError, msgspec.MsgspecError) as error:
        raise StorageError(f"{folder} is no LeRobot data set: {error}", "Give the folder that holds meta/.") from error
    if not info.codebase_version.startswith("v3."):
        what = f"{folder} is a data set of version {info.codebase_version}"
        raise StorageError(what, "Convert it to v3.0 with LeRobot.")
    return info


def features_for(info: Info, profile: RobotProfile, named: Mapping[str, str]) -> dict[str, str]:
    """Return which feature of a data set is each of what a robot learns from. Raises `ConfigError`. Pure."""
    if "action" not in info.features or info.features["action"].shape != [2]:
        raise ConfigError("the data set's action is not two numbers", "It has to be linear and angular, in [-1, 1].")
    pictures = [key for key, each in info.features.items() if each.dtype in PICTURES]
    found = {}
    for row in modalities_of(profile):
        shape = list(row.shape(profile))
        usual = SCAN if row.trunk == "scan" else f"observation.images.{row.sensor}"
        only = pictures[0] if row.name == "image" and len(pictures) == 1 else ""
        key = named.get(row.name) or (usual if usual in info.features else only)
        if key not in info.features:
            what = f"it is not clear which feature of the data set is the robot's {row.name}"
            raise ConfigError(what, f"Say so with --map {row.name}=FEATURE; there are {', '.join(info.features)}.")
        feature = info.features[key]
        if (row.trunk == "picture") != (feature.dtype in PICTURES) or (row.trunk == "scan" and feature.shape != shape):
            what = f"'{key}' is {feature.dtype} {feature.shape}, the {row.name} of '{profile.name}' is {shape}"
            raise ConfigError(what, "Name another feature with --map, or another robot with --profile.")
        found[row.name] = key
    return found


def _episodes(folder: Path) -> list[dict[str, Any]]:
    tables = [pq.read_table(path) for path in sorted((folder / "meta/episodes").glob("*/*.parquet"))]
    rows = [row for table in tables for row in table.select(_without_statistics(table)).to_pylist()]
    return sorted(rows, key=lambda row: int(row["episode_index"]))


def _without_statistics(table: pa.Table) -> list[str]:
    return [name for name in table.column_names if not name.startswith("stats/")]


def _rows(folder: Path, info: Info, episode: Mapping[str, Any]) -> pa.Table:
    where = {"chunk_index": episode["data/chunk_index"], "file_index": episode["data/file_index"]}
    only = [("episode_index", "=", episode["episode_index"])]
    return pq.read_table(folder / info.data_path.format(**where), filters=only).sort_by("frame_index")


def _chosen(rows: pa.Table, frames: Frames | None) -> list[bool]:
    wanted = frames or ("interventions" if CHOSEN_BY["interventions"] in rows.column_names else "all")
    if wanted == "all":
        return [True] * len(rows)
    column = CHOSEN_BY[wanted]
    if column not in rows.column_names:
        raise ConfigError(f"the data set has no '{column}'", "Take --frames all.")
    return [bool(value) for value in rows[column].to_pylist()]


def _pictures(folder: Path, info: Info, episode: Mapping[str, Any], key: str) -> Iterator[ByteArray]:
    """Yield an episode's pictures, RGB, one for each frame."""
    begin_s, end_s = (float(episode[f"videos/{key}/{edge}_timestamp"]) for edge in ("from", "to"))
    where = {name: episode[f"videos/{key}/{name}"] for name in ("chunk_index", "file_index")}
    path = (info.video_path or "").format(video_key=key, **where)
    with av.open(str(folder / path)) as file:
        stream = file.streams.video[0]
        file.seek(int(Fraction(begin_s) / (stream.time_base or Fraction(1))), stream=stream, backward=True)
        for frame in file.decode(stream):
            if frame.time is not None and frame.time >= end_s - EARLY_S:
                return
            if frame.time is not None and frame.time >= begin_s - EARLY_S:
                yield frame.to_ndarray(format="rgb24").astype(np.uint8, copy=False)


def _shown(
    row: Mapping[str, Any],
    episode: int,
    sources: Mapping[str, str],
    pictures: Mapping[str, ByteArray | None],
    profile: RobotProfile,
) -> Shown:
    arrays = {
        name: _picture(pictures.get(name), row.get(key), profile.features.image_px)
        if name in pictures or isinstance(row.get(key), dict)
        else np.array(row[key], np.float32)
        for name, key in sources.items()
    }
    linear, angular = row["action"]
    source = str(row.get("source") or Driver.HUMAN)
    return Shown(float(row["timestamp"]), episode, Features(**arrays), (float(linear), float(angular)), source)


def _picture(rgb: ByteArray | None, kept: Any, px: int) -> FloatArray:
    """A frame of a video, or a picture as it is kept among the numbers. Raises `StorageError` if there is none."""
    if rgb is not None:
        return gray_image(Image(0.0, rgb), px)
    if isinstance(kept, dict) and isinstance(kept.get("bytes"), bytes):
        return gray_image(CompressedImage(0.0, kept["bytes"]), px)
    raise StorageError("a frame has no picture", "Is the data set whole?")
