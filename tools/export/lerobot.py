"""LeRobotDataset v3.0: a folder of parquet, MP4 and JSON that LeRobot trains from.

`meta/info.json` names the features, `meta/stats.json` their statistics, `meta/tasks.parquet` the tasks;
`meta/episodes/` says where each episode lies in `data/` and in `videos/`. All episodes are in one file of each.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from lira.hal.errors import StorageError
from lira.tools.export import video
from lira.tools.export.columns import Column, Kind, Table
from lira.tools.export.pictures import Cameras, Pictures, Size
from lira.tools.export.statistics import PictureSampler, Statistics, merged, statistics_of

VERSION = "v3.0"
PICTURES = "observation.images."  # and the camera's name
FILE = "chunk-000/file-000"
FILES = "chunk-{chunk_index:03d}/file-{file_index:03d}"
MOST_FILES, DATA_MB, VIDEO_MB = 1000, 100, 200  # what others who append keep to
ARROW = {
    "float32": pa.float32(),
    "float64": pa.float64(),
    "int64": pa.int64(),
    "bool": pa.bool_(),
    "string": pa.string(),
}
# What every row of a data set has, whatever the robot.
COUNTED: dict[str, Kind] = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}


def write_lerobot(tables: Sequence[Table], cameras: Cameras, folder: Path, *, robot: str, task: str, fps: int) -> None:
    """Write a new folder. Raises `StorageError`."""
    sizes = {f"{PICTURES}{name}": pictures.size or (0, 0) for name, pictures in cameras.items()}
    try:
        folder.mkdir(parents=True)
        seen = {f"{PICTURES}{name}": _write_pictures(folder, name, tables, each, fps) for name, each in cameras.items()}
        statistics = _statistics(tables, seen, fps)
        _write_parquet(folder / f"data/{FILE}.parquet", _data(tables, fps))
        _write_parquet(folder / f"meta/episodes/{FILE}.parquet", _episodes(tables, statistics, list(sizes), task, fps))
        _write_parquet(folder / "meta/tasks.parquet", _tasks(task))
        whole = {name: merged([each[name] for each in statistics]) for name in statistics[0]}
        _write_json(folder / "meta/stats.json", whole)
        _write_json(folder / "meta/info.json", _info(tables, robot=robot, sizes=sizes, fps=fps))
    except OSError as error:
        raise StorageError(f"cannot write {folder}: {error.strerror or error}", "Choose another folder.") from error


def _write_pictures(folder: Path, name: str, tables: Sequence[Table], pictures: Pictures, fps: int) -> list[Statistics]:
    """Write all of a camera's; returns their statistics by episode. They are told once for both."""
    sampler = PictureSampler(list(map(len, tables)))
    all_steps = (step for table in tables for step in table.episode.steps)
    path = folder / f"videos/{PICTURES}{name}/{FILE}.mp4"
    video.write_video(path, sampler.through(pictures.of(all_steps)), pictures.size or (0, 0), fps)
    return sampler.statistics()


def _with_counts(tables: Sequence[Table], fps: int) -> Iterator[tuple[Table, tuple[Column, ...]]]:
    """Yield each episode with its columns and those that every data set has."""
    first = 0
    for number, table in enumerate(tables):
        frames = np.arange(len(table))
        values = {
            "timestamp": frames / fps,
            "frame_index": frames,
            "episode_index": np.full(len(table), number),
            "index": frames + first,
            "task_index": np.zeros(len(table)),
        }
        first += len(table)
        counted = tuple(Column(name, kind, values[name].astype(kind)) for name, kind in COUNTED.items())
        yield table, (*table.columns, *counted)


def _data(tables: Sequence[Table], fps: int) -> pa.Table:
    parts = [pa.table({column.name: _arrow(column) for column in columns}) for _, columns in _with_counts(tables, fps)]
    return pa.concat_tables(parts)


def _arrow(column: Column) -> pa.Array:
    if not column.names:
        return pa.array(column.values.tolist(), ARROW[column.kind])
    flat = pa.array(np.ascontiguousarray(column.values).reshape(-1), pa.float32())
    return pa.FixedSizeListArray.from_arrays(flat, len(column.names))


def _statistics(
    tables: Sequence[Table], seen: Mapping[str, Sequence[Statistics]], fps: int
) -> list[dict[str, Statistics]]:
    """Return those of each episode by feature; `seen` are those of pictures."""
    return [
        {column.name: statistics_of(column.values) for column in columns if column.kind != "string"}
        | {name: each[number] for name, each in seen.items()}
        for number, (_, columns) in enumerate(_with_counts(tables, fps))
    ]


def _episodes(
    tables: Sequence[Table], statistics: Sequence[Mapping[str, Statistics]], seen: Sequence[str], task: str, fps: int
) -> pa.Table:
    rows, first = [], 0
    for number, (table, found) in enumerate(zip(tables, statistics, strict=True)):
        end = first + len(table)
        row: dict[str, Any] = {
            "episode_index": number,
            "tasks": [task],
            "length": len(table),
            "data/chunk_index": 0,
            "data/file_index": 0,
            "dataset_from_index": first,
            "dataset_to_index": end,
        }
        for name in seen:
            row |= {
                f"videos/{name}/chunk_index": 0,
                f"videos/{name}/file_index": 0,
                f"videos/{name}/from_timestamp": first / fps,
                f"videos/{name}/to_timestamp": end / fps,
            }
        row |= {f"stats/{name}/{key}": value for name, each in found.items() for key, value in each.items()}
        rows.append(row | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0})
        first = end
    return pa.Table.from_pylist(rows)


def _tasks(task: str) -> pa.Table:
    """One task. Its words are what pandas calls the index, so they are named as such."""
    table = pa.table({"task_index": pa.array([0], pa.int64()), "task": pa.array([task])})
    column = {"metadata": None, "field_name": "task", "name": "task", "pandas_type": "unicode", "numpy_type": "object"}
    number = {
        "metadata": None,
        "field_name": "task_index",
        "name": "task_index",
        "pandas_type": "int64",
        "numpy_type": "int64",
    }
    words = {"index_columns": ["task"], "column_indexes": [], "columns": [number, column], "pandas_version": "2.0.0"}
    return table.replace_schema_metadata({"pandas": json.dumps(words)})


def _info(tables: Sequence[Table], *, robot: str, sizes: Mapping[str, Size], fps: int) -> dict[str, Any]:
    features = {
        column.name: {
            "dtype": column.kind,
            "shape": [len(column.names) or 1],
            "names": list(column.names) or None,
        }
        for column in tables[0].columns
    }
    features |= {name: _camera(*video.even(size), fps) for name, size in sizes.items()}
    features |= {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in COUNTED.items()}
    return {
        "codebase_version": VERSION,
        "robot_type": robot,
        "total_episodes": len(tables),
        "total_frames": sum(map(len, tables)),
        "total_tasks": 1,
        "chunks_size": MOST_FILES,
        "data_files_size_in_mb": DATA_MB,
        "video_files_size_in_mb": VIDEO_MB,
        "fps": fps,
        "splits": {"train": f"0:{len(tables)}"},
        "data_path": f"data/{FILES}.parquet",
        "video_path": f"videos/{{video_key}}/{FILES}.mp4" if sizes else None,
        "features": features,
    }


def _camera(height: int, width: int, fps: int) -> dict[str, Any]:
    about = {
        "video.height": height,
        "video.width": width,
        "video.codec": video.CODEC,
        "video.pix_fmt": video.PIXELS,
        "video.is_depth_map": False,
        "video.fps": fps,
        "video.channels": 3,
        "has_audio": False,
    }
    return {"dtype": "video", "shape": [height, width, 3], "names": ["height", "width", "channels"], "info": about}


def _write_parquet(path: Path, table: pa.Table) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path, compression="snappy")


def _write_json(path: Path, value: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value, indent=4, allow_nan=False) + "\n", encoding="utf-8")
