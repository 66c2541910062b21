"""What grows with every label, in memory that is taken in large pieces: rows of one shape, and a square matrix."""

from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

LEAST = 64  # rows to begin with
Kind = TypeVar("Kind", bound=np.generic)


class Rows(Generic[Kind]):
    """Rows in one array that doubles when it is full; `rows` is the filled part."""

    def __init__(self, shape: tuple[int, ...], kind: type[Kind] | np.dtype[Kind]) -> None:
        self._data: NDArray[Kind] = np.empty((LEAST, *shape), kind)
        self.count = 0

    @property
    def rows(self) -> NDArray[Kind]:
        """All rows so far."""
        return self._data[: self.count]

    @property
    def row_bytes(self) -> int:
        """Size of one row."""
        return int(self._data[0].nbytes)

    def append(self, row: ArrayLike) -> None:
        """Add a row."""
        if self.count == len(self._data):
            self._data = np.concatenate([self._data, np.empty_like(self._data)])
        self._data[self.count] = row
        self.count += 1

    def remove(self, i: int) -> None:
        """Take a row out; those behind it move up."""
        self._data[i : self.count - 1] = self._data[i + 1 : self.count]
        self.count -= 1


class Square:
    """A square matrix, float64, that gets a row and a column more; `values` [n, n] may be written to."""

    def __init__(self) -> None:
        self._data = np.empty((LEAST, LEAST))
        self.values = self._data[:0, :0]

    def border(self, row: NDArray[np.float64], corner: float) -> None:
        """Add a row [n], the same as a column, and where both meet."""
        n = len(self.values)
        if n == len(self._data):
            self._data = np.empty((2 * n, 2 * n))
            self._data[:n, :n] = self.values
        self.values = self._data[: n + 1, : n + 1]
        self.values[n, :n] = self.values[:n, n] = row
        self.values[n, n] = corner

    def remove(self, i: int) -> None:
        """Take a row and its column out; those behind them move up."""
        n = len(self.values)
        self.values[i:-1] = self.values[i + 1 :]
        self.values[:, i:-1] = self.values[:, i + 1 :]
        self.values = self._data[: n - 1, : n - 1]
