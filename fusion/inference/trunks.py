"""What looks at one feature, in numpy. Networks that look with the same weights share one trunk.

A novice sees with copies of its experts' trunks, and all are asked about the same observation: a trunk remembers what
it saw last, so that it looks once a step, however many networks ask.
"""

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Mapping
from threading import Lock
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from lira.fusion.inference.layers import Convolution, Dense, leaky_relu
from lira.hal.messages import FloatArray

Weights = Mapping[str, NDArray[Any]]
"""Parameters by name, float32."""


class Trunk(ABC):
    """Turns a feature into a vector [size]. May be called from several threads."""

    size: int

    def __init__(self) -> None:
        self._lock = Lock()
        self._seen: bytes | None = None
        self._answer = np.empty(0, np.float32)

    def __call__(self, seen: FloatArray) -> FloatArray:
        """Return what it makes of a feature, not to be written to."""
        same = seen.tobytes()  # compared in a tenth of the time that two arrays take
        with self._lock:
            if self._seen != same:
                self._answer = self._look(seen).copy()
                self._answer.flags.writeable = False
                self._seen = same
            return self._answer

    def glance(self, seen: FloatArray) -> FloatArray:
        """The same of what nobody is going to ask about again: it is not remembered."""
        with self._lock:
            return self._look(seen).copy()

    @abstractmethod
    def _look(self, seen: FloatArray) -> FloatArray:
        """Compute it."""


class PictureTrunk(Trunk):
    """conv3x3(f) -> conv3x3(f) -> maxpool 2, flat. Picture [px, px]."""

    def __init__(self, px: int, weights: Weights) -> None:
        super().__init__()
        self._first = Convolution(weights["conv1.weight"], px, px)
        self._second = Convolution(weights["conv2.weight"], px - 2, px)
        self._bias1, self._bias2 = weights["conv1.bias"][:, None], weights["conv2.bias"][:, None, None]
        filters, self._side = len(self._bias2), (px - 4) // 2
        self.size = filters * self._side**2
        self._scratch = np.empty_like(self._second.input)
        self._rows = np.empty((filters, self._side, 2 * self._side), np.float32)
        self._pooled, self._rest = (np.empty((filters, self._side, self._side), np.float32) for _ in range(2))
        self._px = px

    def _look(self, seen: FloatArray) -> FloatArray:
        self._first.input[0] = seen.ravel()
        hidden = np.add(self._first(), self._bias1, out=self._second.input)
        leaky_relu(hidden, self._scratch)
        # Pooled before bias and rectifier: both are monotonic, so the result is the same for a quarter of the work.
        even = 2 * self._side
        shown = self._second().reshape(len(self._bias2), -1, self._px)[:, :even, :even]
        np.maximum(shown[:, 0::2], shown[:, 1::2], out=self._rows)
        np.maximum(self._rows[:, :, 0::2], self._rows[:, :, 1::2], out=self._pooled)
        np.add(self._pooled, self._bias2, out=self._pooled)
        return leaky_relu(self._pooled, self._rest).ravel()


class ScanTrunk(Trunk):
    """64 -> 64. Scan [bins]."""

    def __init__(self, weights: Weights) -> None:
        super().__init__()
        self._layers = [Dense(weights[f"{at}.weight"], weights[f"{at}.bias"], rectified=True) for at in ("fc1", "fc2")]
        self.size = len(weights["fc2.bias"])

    def _look(self, seen: FloatArray) -> FloatArray:
        first, second = self._layers
        return second(first(seen))


_known: WeakValueDictionary[bytes, Trunk] = WeakValueDictionary()


def trunk_with(shape: tuple[int, ...], weights: Weights) -> Trunk:
    """Return the trunk with these weights that looks at features of this shape: one, for all who see with it."""
    digest = hashlib.sha256(repr(shape).encode())
    for name, array in sorted(weights.items()):
        digest.update(name.encode() + np.ascontiguousarray(array).tobytes())
    key = digest.digest()
    trunk = _known.get(key)
    if trunk is None:
        trunk = ScanTrunk(weights) if len(shape) == 1 else PictureTrunk(shape[0], weights)
        _known[key] = trunk
    return trunk
