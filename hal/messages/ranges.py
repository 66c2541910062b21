"""What a range of a scan means: the one definition for the protective field, the networks' input and measurements.

| it reads | it means | becomes |
|---|---|---|
| between `range_min` and `range_max`, both included | a return there | itself |
| above `range_max`, +inf | no return | +inf |
| below `range_min` but positive, -inf | too close | -inf |
| 0 or negative (what some drivers write for "none"), nan | nothing is known | nan |

After REP-117. In a scan whose own limits make no sense (nan, negative, or empty) nothing is known.
"""

import numpy as np
from numpy.typing import NDArray

from lira.hal.messages import FloatArray, LaserScan


def read_ranges(scan: LaserScan, beams: NDArray[np.intp] | None = None) -> FloatArray:
    """Return a scan's ranges, float32 [n], or those of `beams` alone, as the table says."""
    ranges: FloatArray = np.asarray(scan.ranges, dtype=np.float32)
    ranges = ranges.copy() if beams is None else ranges[beams]
    # As float32, like the ranges: a range at the very limit is within it.
    low, high = np.float32(scan.range_min), np.float32(scan.range_max)
    if not 0.0 <= low < high:
        return np.full_like(ranges, np.nan)
    known = (ranges > 0.0) | np.isneginf(ranges)  # nan is neither
    ranges[ranges > high] = np.inf
    ranges[ranges < low] = -np.inf
    ranges[~known] = np.nan
    return ranges
