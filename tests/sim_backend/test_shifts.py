"""How worlds and robots are shifted, and a world in which every layout is shifted a little."""

import msgspec
import numpy as np
import pytest

from lira.hal.errors import ConfigError
from lira.hal.messages import Command, CourseState, Episode, Twist
from lira.hal.profile import load_profile
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.foresight import Foresight
from lira.sim_backend.layout import build
from lira.sim_backend.shifts import BENDS, BOXES, DRAWN, SHIFTS, SLIP_TURN, gray, shifted, surroundings
from lira.sim_backend.twin import Twin

PROFILE = load_profile("thesis-sim")
WORLD = load_world("line-obstacles")
RANDOMISED = msgspec.structs.replace(WORLD, randomised=True)
TURN = Twist(0.5, 1.0)


@pytest.mark.parametrize("shift", SHIFTS)
def test_every_shift_changes_something_and_leaves_a_world_that_can_be_built(shift):
    world, profile = shifted(shift, WORLD, PROFILE)
    assert (world, profile) != (WORLD, PROFILE)
    assert (world == WORLD) != (profile == PROFILE)
    assert len(build(world, 3).blocks) == 8


def test_nothing_is_shifted_that_nobody_asked_for():
    assert shifted(None, WORLD, PROFILE) == (WORLD, PROFILE)
    assert surroundings(WORLD, PROFILE, 5) == (WORLD, PROFILE)


@pytest.mark.parametrize("shift", [shift for shift, _ in DRAWN])
def test_none_of_a_shift_is_no_shift(shift):
    assert shift(WORLD, PROFILE, 0.0) == (WORLD, PROFILE)


def test_boxes_grow_but_stay_as_high_and_bends_get_tighter():
    plain, grown = build(WORLD, 3).blocks[0], build(shifted("boxes", WORLD, PROFILE)[0], 3).blocks[0]
    assert grown.length_m == pytest.approx(BOXES * plain.length_m)
    assert grown.height_m == plain.height_m
    tight = build(shifted("curvature", WORLD, PROFILE)[0], 3).curve
    assert tight.length_m == pytest.approx(BENDS * build(WORLD, 3).curve.length_m, rel=1e-3)
    turns = [np.abs(np.diff(np.unwrap(each.headings))).max() for each in (build(WORLD, 3).curve, tight)]
    assert turns[1] > turns[0]


def test_bends_of_a_world_with_boxes_in_fixed_places_are_left_alone():
    with pytest.raises(ConfigError, match="bends"):
        shifted("curvature", load_world("corridor"), PROFILE)


@pytest.mark.parametrize(("name", "robot"), [("line-obstacles", "thesis-sim"), ("corridor", "rosbot2")])
def test_each_layout_of_a_randomised_world_has_surroundings_of_its_own_within_the_shifts(name, robot):
    world, profile = msgspec.structs.replace(load_world(name), randomised=True), load_profile(robot)
    drawn = [surroundings(world, profile, layout) for layout in range(40)]
    assert drawn == [surroundings(world, profile, layout) for layout in range(40)]
    dark, light = (gray(world, profile, amount)[0].ground_gray for amount in (1.0, -1.0))
    grays = [place.ground_gray for place, _ in drawn]
    assert dark <= min(grays) < world.ground_gray < max(grays) <= light
    nominal = profile.base.max_angular_rad_s
    turns = [body.base.max_angular_rad_s / nominal for _, body in drawn]
    assert 1.0 - SLIP_TURN <= min(turns) < 0.9 < max(turns) <= 1.0
    pitches = [body.camera.pitch_rad - profile.camera.pitch_rad for _, body in drawn]
    assert min(pitches) < 0.0 < max(pitches)
    assert max(body.lidar.noise_m for _, body in drawn) > profile.lidar.noise_m
    assert {len(build(place, 3).blocks) for place, _ in drawn} == {len(build(world, 3).blocks)}


@pytest.fixture
def twins():
    made = []

    def make(world, layout=0):
        made.append(Twin(PROFILE, world, layout=layout, renderer="sketch"))
        made[-1].open()
        return made[-1]

    yield make
    for each in made:
        each.close()


def seen(twin):
    picture = twin.read().image.data
    return picture.reshape(picture.shape[0], -1)


def test_a_twin_in_a_randomised_world_looks_as_its_layout_says_whichever_it_came_from(twins):
    fresh, moved = twins(RANDOMISED, 7), twins(RANDOMISED, 3)
    assert seen(fresh)[0, 0] != seen(moved)[0, 0]
    moved.reset(Episode(7))
    sky, floor = surroundings(RANDOMISED, PROFILE, 7)[0].sky_gray, surroundings(RANDOMISED, PROFILE, 7)[0].ground_gray
    for twin in (fresh, moved):
        rows = np.median(seen(twin), axis=1)
        assert abs(rows[0] - sky) < 6.0
        assert np.abs(rows - floor).min() < 6.0
    assert moved.profile == PROFILE  # what it says of itself is what the learner knows


def test_wheels_slip_as_the_layout_says_and_the_teacher_foresees_it(twins):
    layout = max(range(20), key=lambda each: -surroundings(RANDOMISED, PROFILE, each)[1].base.max_angular_rad_s)
    share = surroundings(RANDOMISED, PROFILE, layout)[1].base.max_angular_rad_s / PROFILE.base.max_angular_rad_s
    twin = twins(RANDOMISED, layout)
    applied = twin.drive(Command(TURN, twin.now()))
    twin.wait(2.0)
    assert applied.twist == TURN  # what the wheels were told
    assert twin.state().angular_rad_s == pytest.approx(share * TURN.angular_rad_s)
    foresight = Foresight(PROFILE, RANDOMISED, layout)
    base = PROFILE.base
    action = TURN.linear_m_s / base.max_linear_m_s, TURN.angular_rad_s / base.max_angular_rad_s
    start = CourseState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.0, False, False, False)
    try:
        last = foresight.rollout(start, lambda _: action, 10, 0.2, lambda _: False)[-1]
    finally:
        foresight.close()
    assert last.angular_rad_s == pytest.approx(twin.state().angular_rad_s)
