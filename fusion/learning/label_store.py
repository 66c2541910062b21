"""Rows of one shape that may outgrow the memory: the first ones in an array, the others in a file."""

import errno
import os
import tempfile
import weakref
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from lira.hal.messages import ByteArray, FloatArray


class Rows:
    """Rows in one array that doubles when it is full; `rows` is the filled part."""

    def __init__(self, shape: tuple[int, ...], dtype: torch.dtype) -> None:
        self._data = torch.empty((64, *shape), dtype=dtype)
        self.count = 0

    @property
    def rows(self) -> Tensor:
        """All rows so far."""
        return self._data[: self.count]

    @property
    def row_bytes(self) -> int:
        """Size of one row."""
        return self._data[0].nbytes

    def append(self, row: Tensor) -> None:
        """Add a row."""
        if self.count == len(self._data):
            self._data = torch.cat([self._data, torch.empty_like(self._data)])
        self._data[self.count] = row
        self.count += 1


class FileRows:
    """Scans (float32) and images (uint8) in a file without a name, which is gone with the process.

    Read and written by position, so that the file's pages are the system's cache and never this process's memory.
    """

    def __init__(self, scan: tuple[int, ...], image: tuple[int, ...]) -> None:
        self._row = np.dtype([("scan", np.float32, scan), ("image", np.uint8, image)])
        self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - lives as long as the rows do
        weakref.finalize(self, self._file.close)
        self.count = 0

    def append(self, scan: FloatArray, image: ByteArray) -> None:
        """Add a row. Raises `OSError` when the disk is full."""
        data = scan.tobytes() + image.tobytes()
        written = os.pwrite(self._file.fileno(), data, self.count * self._row.itemsize)
        if written < len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self.count += 1

    def read(self, indices: Sequence[int]) -> tuple[Tensor, Tensor]:
        """Return the scans [n, bins] and images [n, px, px] of some rows."""
        size = self._row.itemsize
        data = b"".join(os.pread(self._file.fileno(), size, index * size) for index in indices)
        rows = np.frombuffer(data, self._row)
        return torch.from_numpy(rows["scan"].copy()), torch.from_numpy(rows["image"].copy())
