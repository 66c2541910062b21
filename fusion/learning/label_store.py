"""Rows of one shape that may outgrow the memory, in a file."""

import errno
import os
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor


class FileRows:
    """Arrays by name in a file without a name, which is gone with the process.

    Read and written by position, so that the file's pages are the system's cache and never this process's memory.
    """

    def __init__(self, like: Mapping[str, NDArray[Any]]) -> None:
        self._row = np.dtype([(name, array.dtype, array.shape) for name, array in like.items()])
        self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - lives as long as the rows do
        weakref.finalize(self, self._file.close)
        self.count = 0

    def append(self, row: Mapping[str, NDArray[Any]]) -> None:
        """Add a row. Raises `OSError` when the disk is full."""
        data = b"".join(row[name].tobytes() for name in self._row.names or ())
        written = os.pwrite(self._file.fileno(), data, self.count * self._row.itemsize)
        if written < len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self.count += 1

    def read(self, indices: Sequence[int]) -> dict[str, Tensor]:
        """Return the arrays of some rows by name, each [n, *shape]."""
        size = self._row.itemsize
        data = b"".join(os.pread(self._file.fileno(), size, index * size) for index in indices)
        rows = np.frombuffer(data, self._row)
        return {name: torch.from_numpy(rows[name].copy()) for name in self._row.names or ()}
