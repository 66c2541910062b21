"""What grows with every label, in memory that is taken in large pieces: rows of one shape, and a square matrix."""

import torch
from torch import Tensor

LEAST = 64  # rows to begin with


class Rows:
    """Rows in one array that doubles when it is full; `rows` is the filled part."""

    def __init__(self, shape: tuple[int, ...], dtype: torch.dtype) -> None:
        self._data = torch.empty((LEAST, *shape), dtype=dtype)
        self.count = 0

    @property
    def rows(self) -> Tensor:
        """All rows so far."""
        return self._data[: self.count]

    @property
    def row_bytes(self) -> int:
        """Size of one row."""
        return self._data[0].nbytes

    def append(self, row: Tensor | float) -> None:
        """Add a row."""
        if self.count == len(self._data):
            self._data = torch.cat([self._data, torch.empty_like(self._data)])
        self._data[self.count] = row
        self.count += 1

    def remove(self, i: int) -> None:
        """Take a row out; those behind it move up."""
        self._data[i : self.count - 1] = self._data[i + 1 : self.count].clone()
        self.count -= 1


class Square:
    """A square matrix that gets a row and a column more; `values` [n, n] may be written to."""

    def __init__(self, dtype: torch.dtype) -> None:
        self._data = torch.empty((LEAST, LEAST), dtype=dtype)
        self.values = self._data[:0, :0]

    def border(self, row: Tensor, corner: float) -> None:
        """Add a row [n], the same as a column, and where both meet."""
        n = len(self.values)
        if n == len(self._data):
            self._data = self._data.new_empty((2 * n, 2 * n))
            self._data[:n, :n] = self.values
        self.values = self._data[: n + 1, : n + 1]
        self.values[n, :n] = self.values[:n, n] = row
        self.values[n, n] = corner

    def remove(self, i: int) -> None:
        """Take a row and its column out; those behind them move up."""
        n = len(self.values)
        self.values[i:-1] = self.values[i + 1 :].clone()
        self.values[:, i:-1] = self.values[:, i + 1 :].clone()
        self.values = self._data[: n - 1, : n - 1]
