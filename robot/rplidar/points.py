"""What a stream of the RPLIDAR becomes: points, whatever the answer type they came in."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]

NOTHING: Floats = np.empty(0)
# No head turns faster, and no unit takes longer for a sample.
FASTEST_HZ, LONGEST_SAMPLE_S = 20.0, 510e-6
# Only the angles of points with a distance are corrected, and by how much depends on it: they step back so far.
CORRECTION_RAD = math.radians(8.0)


@dataclass(frozen=True, slots=True)
class Points:
    """A piece of a stream. `theta_rad`: clockwise from the unit's front, [0, 2 pi); `distance_m`: 0 for none.

    `lost` bytes made no sense, or are missing. `waiting` points have come that are not among these.
    """

    theta_rad: Floats
    distance_m: Floats
    lost: int = 0
    waiting: int = 0

    def __len__(self) -> int:
        return len(self.theta_rad)


class Decoder(Protocol):
    """Reads one answer type. It keeps what is not complete until the rest comes, and is never at a loss.

    `size`: bytes of a packet. `back_rad`: how far the angles of good points may step back.
    """

    size: int
    back_rad: float

    def feed(self, data: bytes) -> Points:
        """Take what came, and return the points that it completes."""

    @property
    def left(self) -> int:
        """Bytes that wait for more."""
