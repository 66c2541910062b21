"""One meaning of a range, for everybody who looks at a scan."""

import math

import numpy as np
import pytest

from lira.fusion.modalities.scan import bin_scan
from lira.hal.messages import LaserScan
from lira.hal.messages.ranges import read_ranges
from lira.hal.profile import load_profile
from lira.hal.safety.protective_field import measure_clearance

PROFILE = load_profile("rosbot2")
NAN, INF = math.nan, math.inf


def scan(*ranges, range_min=0.15, range_max=12.0):
    return LaserScan(0.0, -math.pi, math.tau / len(ranges), range_min, range_max, np.array(ranges, np.float32))


@pytest.mark.parametrize(("reads", "means"), [
    (1.0, 1.0),
    (0.15, np.float32(0.15)),
    (12.0, 12.0),
    (0.1, -INF),
    (1e-30, -INF),
    (-INF, -INF),
    (12.1, INF),
    (65.535, INF),
    (INF, INF),
    (0.0, NAN),
    (-0.0, NAN),
    (-1e-9, NAN),
    (-5.0, NAN),
    (NAN, NAN),
])  # fmt: skip
def test_what_a_range_means(reads, means):
    shown = scan(reads, 1.0)
    assert read_ranges(shown)[0] == pytest.approx(means, abs=0.0, nan_ok=True)
    assert read_ranges(shown, np.array([1, 0]))[1] == pytest.approx(means, abs=0.0, nan_ok=True)
    assert shown.ranges[0] == pytest.approx(np.float32(reads), abs=0.0, nan_ok=True)  # the scan is left as it is


@pytest.mark.parametrize("limits", [(NAN, 12.0), (0.15, NAN), (-0.1, 12.0), (0.0, 0.0), (2.0, 1.0), (0.15, -1.0)])
def test_limits_that_make_no_sense_tell_nothing(limits):
    shown = scan(*[1.0, INF, -INF] * 10, range_min=limits[0], range_max=limits[1])
    assert np.isnan(read_ranges(shown)).all()


def test_limits_may_be_open():
    assert read_ranges(scan(0.01, 500.0, range_min=0.0, range_max=INF)).tolist() == pytest.approx([0.01, 500.0])


@pytest.mark.parametrize("reads", [0.0, -5.0, NAN, 13.0, INF, 2.0])
def test_field_and_networks_agree_on_what_is_seen(reads):
    """A scan in which half the beams read so, the others 2 m: those are known to both or to neither."""
    beams = PROFILE.lidar.beams
    ranges = np.full(beams, 2.0, np.float32)
    ranges[::2] = reads
    shown = scan(*ranges)
    blind = measure_clearance(PROFILE, PROFILE.field, shown).ahead_m == 0.0
    _, invalid = bin_scan(shown, PROFILE.features)
    assert (invalid > 0) is blind is (math.isnan(reads) or -INF < reads <= 0.0)
