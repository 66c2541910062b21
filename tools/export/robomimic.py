"""robomimic: one HDF5 file with a group for each episode, `data/demo_0` and so on.

`obs` holds what a policy sees (`state`, `scan`, `image`), `actions` what was driven, in [-1, 1]. All other columns lie
beside them under their own names. `mask/train`, `mask/prove` and `mask/unseen` list the episodes of a phase.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from lira.hal.errors import StorageError
from lira.hal.messages import Phase
from lira.tools.export.columns import SCAN, Table
from lira.tools.export.pictures import Size, pictures_of, size_of

GYM = 2  # robomimic's number for environments that are neither of its two simulators
OBSERVED = {"observation.state": "state", SCAN: "scan"}


def write_robomimic(tables: Sequence[Table], path: Path, about: Mapping[str, str]) -> None:
    """Write a new file; `about` says of which robot and world. Raises `StorageError`."""
    size = size_of(step for table in tables for step in table.episode.steps)
    try:
        with h5py.File(path, "x") as file:
            data = file.create_group("data")
            data.attrs["total"] = sum(map(len, tables))
            data.attrs["env_args"] = json.dumps(
                {"env_name": about.get("world", ""), "type": GYM, "env_kwargs": dict(about)}
            )
            for number, table in enumerate(tables):
                _write_episode(data.create_group(f"demo_{number}"), table, size)
            for phase in Phase:
                names = [f"demo_{n}" for n, table in enumerate(tables) if table.episode.phase == phase]
                if names:
                    file.create_dataset(f"mask/{phase}", data=np.array(names, dtype="S"))
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error}", "Choose another file.") from error


def _write_episode(group: Any, table: Table, size: Size | None) -> None:
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
    if size is not None:
        pictures = group.create_dataset("obs/image", (count, *size, 3), np.uint8, chunks=(1, *size, 3), compression=1)
        for step, picture in enumerate(pictures_of(table.episode.steps, size)):
            pictures[step] = picture
