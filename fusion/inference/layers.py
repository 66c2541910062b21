"""The layers of Appendix B's networks for one observation at a time, in numpy, with nothing allocated on the way.

At a batch of one a framework spends more time on calling its layers than on computing them.
"""

import numpy as np
from numpy.lib.stride_tricks import as_strided

from lira.hal.messages import FloatArray

SLOPE = np.float32(0.3)  # of the leaky rectifiers
KERNEL = 3  # a convolution sees 3 x 3 pixels
ROWS = 7  # that are convolved at a time


def leaky_relu(x: FloatArray, scratch: FloatArray) -> FloatArray:
    """Rectify in place; `scratch` has the same shape."""
    np.multiply(x, SLOPE, out=scratch)
    return np.maximum(x, scratch, out=x)


class Dense:
    """y = W x + b, with a leaky rectifier behind it where `rectified`."""

    def __init__(self, weight: FloatArray, bias: FloatArray, *, rectified: bool) -> None:
        """`weight` float32 [out, in], `bias` [out]."""
        self._weight, self._bias, self._rectified = np.ascontiguousarray(weight), bias, rectified
        self._out, self._scratch = np.empty_like(bias), np.empty_like(bias)

    def __call__(self, x: FloatArray) -> FloatArray:
        """Return y [out] of x [in]; the next call writes over it."""
        y = np.dot(self._weight, x, out=self._out)
        np.add(y, self._bias, out=y)
        return leaky_relu(y, self._scratch) if self._rectified else y

    def all(self, x: FloatArray) -> FloatArray:
        """Return y [n, out] of several x [n, in], in memory of its own."""
        y: FloatArray = x @ self._weight.T + self._bias
        return leaky_relu(y, np.empty_like(y)) if self._rectified else y


class Convolution:
    """3 x 3, valid, stride 1: the patches as columns (im2col), and a product of matrices, a few rows at a time.

    A channel is its rows one behind the other, `pitch` values each, however many of them are valid: so the column of
    one place in the kernel is one piece of memory. Each convolution leaves two values more at the end of a row that
    belong to no pixel. The columns of a few rows stay in the cache, and leave room there for what others need.
    """

    def __init__(self, weight: FloatArray, rows: int, pitch: int) -> None:
        """`weight` float32 [out, in, 3, 3]; the input has so many rows."""
        filters, channels = weight.shape[:2]
        padded = np.zeros((channels, rows * pitch + KERNEL - 1), np.float32)  # the last pixel's patch ends behind it
        self.input = padded[:, : rows * pitch]
        self._weight = np.ascontiguousarray(weight).reshape(filters, -1)
        self._out = np.empty((filters, (rows - KERNEL + 1) * pitch), np.float32)
        columns = np.empty(self._weight.shape[1] * ROWS * pitch, np.float32)
        channel, value = padded.strides
        self._pieces = []
        for begin in range(0, self._out.shape[1], ROWS * pitch):
            out = self._out[:, begin : begin + ROWS * pitch]
            kernel = (channels, KERNEL, KERNEL, out.shape[1])
            places = (channel, value * pitch, value, value)
            patches = as_strided(padded[:, begin:], kernel, places, writeable=False)
            self._pieces.append((patches, columns[: patches.size].reshape(kernel), out))

    def __call__(self) -> FloatArray:
        """Return the output [out, (rows - 2) * pitch] of what is in `input`; the next call writes over it."""
        for patches, columns, out in self._pieces:
            np.copyto(columns, patches)
            np.matmul(self._weight, columns.reshape(self._weight.shape[1], -1), out=out)
        return self._out
