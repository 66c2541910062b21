"""robomimic: one HDF5 file with a group for each episode, `data/demo_0` and so on.

`obs` holds what a policy sees (`state`, `scan`, `image`, and `depth` of a robot that has it), `next_obs` the same a
step later, `actions` what was driven, in [-1, 1]. All other columns lie beside them under their own names.
`mask/train`, `mask/prove` and `mask/unseen` list the episodes of a phase.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from lira.hal.errors import StorageError
from lira.hal.messages import ByteArray, Phase
from lira.tools.export.columns import SCAN, Table
from lira.tools.export.pictures import Cameras

GYM = 2  # robomimic's number for environments that are neither of its two simulators
OBSERVED = {"observation.state": "state", SCAN: "scan", "camera": "image", "depth": "depth"}


def write_robomimic(tables: Sequence[Table], cameras: Cameras, path: Path, about: Mapping[str, str]) -> None:
    """Write a new file; `about` says of which robot and world. Raises `StorageError`."""
    steps = [step for table in tables for step in table.episode.steps]
    passing = {name: (pictures.of(steps), pictures.size) for name, pictures in cameras.items()}
    try:
        with h5py.File(path, "x") as file:
            data = file.create_group("data")
            data.attrs["total"] = len(steps)
            env_args = {"env_name": about.get("world", ""), "type": GYM, "env_kwargs": dict(about)}
            data.attrs["env_args"] = json.dumps(env_args)
            for number, table in enumerate(tables):
                group = data.create_group(f"demo_{number}")
                _write_columns(group, table)
                for name, (pictures, size) in passing.items():
                    _write_pictures(group, OBSERVED[name], pictures, (len(table), *(size or (0, 0)), 3))
                for name in list(group["obs"]):
                    _point_to_next(group, name)
            _write_masks(file, tables)
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error}", "Choose another file.") from error


def _write_columns(group: Any, table: Table) -> None:
    count = len(table)
    group.attrs["num_samples"] = count
    group.create_dataset("actions", data=table["action"].values)
    group.create_dataset("rewards", data=np.zeros(count))
    group.create_dataset("dones", data=np.arange(count) == count - 1, dtype="i8")
    for column in table.columns:
        if column.name in OBSERVED:
            group.create_dataset(f"obs/{OBSERVED[column.name]}", data=column.values)
        elif column.name != "action":
            kind = h5py.string_dtype() if column.kind == "string" else column.values.dtype
            group.create_dataset(column.name, data=column.values, dtype=kind)


def _write_pictures(group: Any, name: str, passing: Iterator[ByteArray], shape: tuple[int, ...]) -> None:
    written = group.create_dataset(f"obs/{name}", shape, np.uint8, chunks=(1, *shape[1:]), compression=1)
    for step, picture in enumerate(islice(passing, shape[0])):
        written[step] = picture


def _point_to_next(group: Any, name: str) -> None:
    """Have what is seen a step later without a second copy of it; the last step has its own."""
    seen = group[f"obs/{name}"]
    layout, source = h5py.VirtualLayout(seen.shape, seen.dtype), h5py.VirtualSource(seen)
    layout[-1:] = source[-1:]
    if len(seen) > 1:
        layout[:-1] = source[1:]
    group.create_virtual_dataset(f"next_obs/{name}", layout)


def _write_masks(file: Any, tables: Sequence[Table]) -> None:
    for phase in Phase:
        names = [f"demo_{number}" for number, table in enumerate(tables) if table.episode.phase == phase]
        if names:
            file.create_dataset(f"mask/{phase}", data=np.array(names, dtype="S"))
