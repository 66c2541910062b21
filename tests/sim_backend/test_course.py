import math

import numpy as np
import pytest

from lira.hal.profile import load_profile
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.course import Course, Obstacles, footprint_radius_m
from lira.sim_backend.layout import Block, build


@pytest.fixture(scope="module")
def eight():
    return build(load_world("eight")).curve


@pytest.mark.parametrize("world", ["line", "line-obstacles", "eight", "race"])
def test_a_place_put_down_relative_to_the_line_is_found_again(world):
    curve = build(load_world(world)).curve
    for progress in np.linspace(0.3, curve.length_m - 0.3, 40):
        for lateral in (-0.7, 0.0, 0.4):
            x, y, yaw = curve.pose(progress, lateral)
            found = curve.project(np.array([x, y]), progress + 0.4)
            assert found[0] == pytest.approx(progress, abs=0.02)
            assert found[1] == pytest.approx(lateral, abs=2e-3)
            assert math.remainder(found[2] - yaw, math.tau) == pytest.approx(0.0, abs=0.01)


def test_at_the_crossing_of_the_eight_the_hint_keeps_the_branch(eight):
    crossing = [eight.pose(s)[:2] for s in (eight.length_m / 2 - 3.874, eight.length_m - 3.874)]
    assert crossing[0] == pytest.approx(crossing[1], abs=0.02)
    first = eight.length_m / 2 - 3.874
    for hint in (first, eight.length_m - 3.874):
        progress, lateral, _ = eight.project(np.array(crossing[0]), hint)
        assert progress == pytest.approx(hint, abs=0.05)
        assert lateral == pytest.approx(0.0, abs=0.01)


def test_progress_grows_over_the_laps(eight):
    hint = 0.0
    for s in np.arange(0.0, 2.5 * eight.length_m, 0.2):
        x, y, _ = eight.pose(s, 0.3)
        hint = float(eight.project(np.array([x, y]), hint)[0])
        assert hint == pytest.approx(s, abs=0.02)


def test_progress_shrinks_when_driving_back_over_the_start(eight):
    x, y, _ = eight.pose(-0.5)
    assert float(eight.project(np.array([x, y]), 0.0)[0]) == pytest.approx(-0.5, abs=0.02)


def test_left_is_positive(eight):
    assert float(eight.project(np.array([0.0, 0.2]), 0.0)[1]) == pytest.approx(0.2, abs=1e-3)
    assert float(eight.project(np.array([0.0, -0.2]), 0.0)[1]) == pytest.approx(-0.2, abs=1e-3)


def test_an_open_line_goes_on_straight_beyond_its_ends():
    curve = build(load_world("race")).curve
    progress, lateral, heading = curve.project(np.array([[-3.0, 1.0], [130.0, -2.0]]))
    assert progress == pytest.approx([-3.0, 130.0])
    assert lateral == pytest.approx([1.0, -2.0])
    assert heading == pytest.approx([0.0, 0.0])


def test_many_poses_at_once_are_as_one_by_one(eight):
    rng = np.random.default_rng(0)
    s = rng.uniform(0.0, eight.length_m, 50)
    xy = np.array([eight.pose(at, off)[:2] for at, off in zip(s, rng.uniform(-1, 1, 50), strict=True)])
    together = eight.project(xy, s)
    for index in range(50):
        alone = eight.project(xy[index], s[index])
        assert [float(v) for v in alone] == [float(v[index]) for v in together]


@pytest.mark.parametrize("world", ["eight", "race", "garden"])
def test_one_place_is_projected_as_many_are_to_the_bit(world):
    """The referee's short way: on the curve, beside it, beyond its ends, laps on, and with a hint that is off."""
    curve = build(load_world(world)).curve
    rng = np.random.default_rng(0)
    for at_m in rng.uniform(-5.0, 2.5 * curve.length_m, 300).tolist():
        inside = at_m if curve.closed else min(max(at_m, -5.0), curve.length_m + 5.0)
        x, y, _ = curve.pose(inside, rng.uniform(-2.0, 2.0))
        hint_m = inside + rng.uniform(-1.0, 1.0)
        progress, lateral, _ = curve.project(np.array([x, y]), hint_m)
        assert curve.project_one(x, y, hint_m) == (float(progress), float(lateral))


def test_distance_to_a_turned_box():
    block = Block(1.0, 2.0, math.pi / 4, 2.0, 1.0, 0.5, 0)
    obstacles = Obstacles.of((block,))
    ahead = np.array([math.cos(math.pi / 4), math.sin(math.pi / 4)])
    left = np.array([-ahead[1], ahead[0]])
    centre = np.array([1.0, 2.0])
    points = np.array([centre + 3 * ahead, centre + 2 * left, centre + 4 * ahead + 4.5 * left, centre])
    assert obstacles.distance(points) == pytest.approx([2.0, 1.5, 5.0, -0.5])


@pytest.mark.parametrize("seed", range(3))
def test_straight_ahead_a_box_is_met_where_a_drive_in_small_steps_first_is_inside(seed):
    random, step_m = np.random.default_rng(seed), 0.005
    rows = random.uniform((-3.0, -3.0, -3.2, 0.2, 0.2), (3.0, 3.0, 3.2, 2.0, 2.0), (4, 5)).tolist()
    obstacles = Obstacles.of(tuple(Block(x, y, yaw, length, width, 0.5, 0) for x, y, yaw, length, width in rows))
    x_m, y_m, yaw_rad = random.uniform(-4.0, 4.0, (3, 300))
    yaw_rad[:8] = np.arange(8) * math.pi / 4
    along_m = np.arange(0.0, 12.0, step_m)
    steps = along_m[:, None] * np.array([np.cos(yaw_rad), np.sin(yaw_rad)])[:, None]
    inside = obstacles.distance(np.stack([x_m + steps[0], y_m + steps[1]], axis=-1)) < 0.0
    driven_m = np.where(inside.any(axis=0), along_m[inside.argmax(axis=0)], np.inf)
    met_m = obstacles.straight_ahead(x_m, y_m, yaw_rad)
    grazed = np.isinf(driven_m) & np.isfinite(met_m)  # over a corner, within one step
    assert np.count_nonzero(grazed) <= 3
    assert 20 < np.count_nonzero(np.isfinite(driven_m)) < 280
    assert met_m[~grazed] == pytest.approx(driven_m[~grazed], abs=1.01 * step_m)
    assert (met_m[driven_m == 0.0] == 0.0).all()


def test_without_boxes_nothing_is_straight_ahead():
    assert Obstacles.of(()).straight_ahead(*np.zeros((3, 2))).tolist() == [math.inf] * 2


def test_without_boxes_the_clearance_is_infinite():
    course = Course(build(load_world("eight")), 0.15)
    assert course.clearance(np.zeros((3, 2))).tolist() == [math.inf] * 3


def test_the_disc_covers_the_footprint():
    base = load_profile("thesis-sim").base
    assert footprint_radius_m(base) == pytest.approx(math.hypot(0.100, 0.1175))


def test_the_end_of_an_open_and_of_a_closed_course():
    race, eight = (Course(build(load_world(name)), 0.15) for name in ("race", "eight"))
    assert not race.finished(119.9, 0.0)
    assert race.finished(120.0, 100.0)
    length = eight.layout.curve.length_m
    assert not eight.finished(length, 1.0)
    assert eight.finished(length + 1.0, 1.0)


@pytest.mark.parametrize(
    ("lateral_m", "clearance_m", "lost"),
    [(0.6, 5.0, False), (-0.8, 5.0, True), (0.8, 0.9, False), (1.6, 0.9, True)],
)
def test_what_is_lost_depends_on_whether_there_is_something_to_drive_around(lateral_m, clearance_m, lost):
    course = Course(build(load_world("line-obstacles")), 0.1)
    assert course.lost(lateral_m, clearance_m) is lost
    assert Course(build(load_world("line")), 0.1).lost(lateral_m, clearance_m) is (abs(lateral_m) > 1.5)
