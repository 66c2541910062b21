"""The layers of Appendix B's networks for one observation at a time, in numpy, with nothing allocated on the way.

At a batch of one a framework spends more time on calling its layers than on computing them.
"""

import numpy as np
from numpy.lib.stride_tricks import as_strided

from lira.hal.messages import FloatArray

SLOPE = np.float32(0.3)  # of the leaky rectifiers
KERNEL = 3  # a convolution sees 3 x 3 pixels


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
    """3 x 3, valid, stride 1: a product of matrices for each column of the kernel, of which the sum is taken.

    A channel is its rows one behind the other, `pitch` values each, however many of them are valid: so what a place in
    the kernel sees of it is one piece of memory, begun somewhat later. The three places of a column are copied below
    each other; the next column sees the same, begun one value later. Each convolution leaves two values more at the end
    of a row that belong to no pixel.
    """

    def __init__(self, weight: FloatArray, rows: int, pitch: int) -> None:
        """`weight` float32 [out, in, 3, 3]; the input has so many rows."""
        filters, channels = weight.shape[:2]
        padded = np.zeros((channels, rows * pitch + KERNEL - 1), np.float32)  # the last pixel's patch ends behind it
        self.input = padded[:, : rows * pitch]
        size = (rows - KERNEL + 1) * pitch
        channel, value = padded.strides
        below = (channels, KERNEL, size + KERNEL - 1)
        self._patches = as_strided(padded, below, (channel, value * pitch, value), writeable=False)
        self._copied = np.empty(below, np.float32)
        seen = self._copied.reshape(channels * KERNEL, -1)
        self._columns = [
            (np.ascontiguousarray(weight[:, :, :, x]).reshape(filters, -1), seen[:, x : x + size])
            for x in range(KERNEL)
        ]
        self._out, self._part = np.empty((filters, size), np.float32), np.empty((filters, size), np.float32)

    def __call__(self) -> FloatArray:
        """Return the output [out, (rows - 2) * pitch] of what is in `input`; the next call writes over it."""
        np.copyto(self._copied, self._patches)
        (weight, seen), *others = self._columns
        np.matmul(weight, seen, out=self._out)
        for weight, seen in others:
            np.add(self._out, np.matmul(weight, seen, out=self._part), out=self._out)
        return self._out
