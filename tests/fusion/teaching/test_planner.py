"""The planner on the twin's own drive model: which way it goes around a box, and that it never goes into one."""

import math

import numpy as np
import pytest

from lira.fusion.control import to_twist
from lira.fusion.teaching.planner import STAGES_S, Planner, action_sequences
from lira.hal.messages import STOP, Command, Episode
from lira.hal.profile import load_profile
from lira.hal.safety.governed import govern
from lira.hal.testing import small_pictures
from lira.sim_backend.foresight import Foresight
from lira.sim_backend.twin import Twin
from lira.sim_backend.world import Box, Limits, Line, Piece, World

PROFILE = load_profile("thesis-sim")
PERIOD_S = PROFILE.period_s
BOX_M = 4.0
STYLES = ["bang-bang", "proportional"]
SWAY_M = {"bang-bang": 0.25, "proportional": 0.12}  # full steer or none weaves along the line


def world(*boxes):
    line = Line(pieces=(Piece(straight_m=40.0),))
    return World(description="straight", line=line, box=boxes, limits=Limits(lost_m=3.0, finish_m=30.0))


ONE_BOX = world(Box(x_m=BOX_M, y_m=0.0))


def drive(floor, style, episode, seconds=7.0, *, follow_line=True):
    """Return the states of a drive by the planner alone."""
    planner = Planner(Foresight(PROFILE, floor), style, PERIOD_S, follow_line=follow_line)
    twin = Twin(PROFILE, floor)
    twin.reset(episode)
    states = [twin.state()]
    while states[-1].stamp_s < seconds:
        twin.drive(Command(to_twist(planner.plan(states[-1]), PROFILE.base), twin.now()))
        twin.wait(twin.now() + PERIOD_S)
        states.append(twin.state())
    return states


def side(states):
    """Return +1 if it passed the box on the left, -1 on the right."""
    beside = min(states, key=lambda state: abs(state.x_m - BOX_M))
    return np.sign(beside.y_m)


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize(
    ("lateral_m", "yaw_rad", "expected"),
    [(0.0, 0.25, 1), (0.0, -0.25, -1), (0.3, 0.0, 1), (-0.3, 0.0, -1), (0.15, 0.2, 1), (-0.15, -0.2, -1)],
)
def test_the_side_follows_from_where_it_stands_and_looks(style, lateral_m, yaw_rad, expected):
    states = drive(ONE_BOX, style, Episode(start_m=2.5, lateral_m=lateral_m, yaw_rad=yaw_rad))
    assert side(states) == expected
    assert not states[-1].collided


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("start_m", [0.0, 1.0, 2.0, 2.6, 3.0])
def test_head_on_it_takes_one_side_and_never_the_box(style, start_m):
    states = drive(ONE_BOX, style, Episode(start_m=start_m))
    assert not any(state.collided for state in states)
    assert states[-1].progress_m > BOX_M + 1.0
    assert abs(states[-1].lateral_m) < SWAY_M[style]  # and back on the line


@pytest.mark.parametrize("style", STYLES)
def test_beside_the_line_it_goes_back_to_it(style):
    states = drive(world(), style, Episode(lateral_m=0.9, yaw_rad=0.4))
    assert abs(states[-1].lateral_m) < SWAY_M[style]


@pytest.mark.parametrize("style", STYLES)
def test_on_a_free_line_it_goes_straight_at_full_speed(style):
    planner = Planner(Foresight(PROFILE, world()), style, PERIOD_S, follow_line=True)
    assert planner.plan(drive(world(), style, Episode(), 0.0)[0]) == pytest.approx((1.0, 0.0))


BEND = World(
    description="a line that bends",
    line=Line(pieces=(Piece(straight_m=8.0), Piece(radius_m=3.0, angle_deg=60.0), Piece(straight_m=20.0))),
    box=(Box(x_m=5.0, y_m=0.1),),
    limits=Limits(lost_m=3.0, finish_m=30.0),
)


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("start_m", [3.5, 9.0])
@pytest.mark.parametrize(("lateral_m", "yaw_rad"), [(-0.4, -2.8), (0.3, -1.2), (-0.4, 2.0), (0.3, math.pi)])
def test_whichever_way_it_looks_it_comes_round_and_never_drives_the_line_backwards(style, start_m, lateral_m, yaw_rad):
    states = drive(BEND, style, Episode(start_m=start_m, lateral_m=lateral_m, yaw_rad=yaw_rad))
    progress_m = [state.progress_m for state in states]
    assert not any(state.collided for state in states)
    assert min(progress_m) > start_m - 1.5  # the room to turn round in
    assert progress_m[-1] > start_m + 2.0
    assert abs(states[-1].lateral_m) < 0.5


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("yaw_rad", [-3.0, -1.9, 1.9, math.pi])
def test_on_the_spot_it_turns_one_way(style, yaw_rad):
    planner = Planner(Foresight(PROFILE, BEND), style, PERIOD_S, follow_line=True)
    twin = Twin(PROFILE, BEND)
    twin.reset(Episode(start_m=4.0, yaw_rad=yaw_rad))
    turns = []
    for _ in range(20):
        action = planner.plan(twin.state())
        turns += [np.sign(action[1])] if action[0] < 0.5 else []
        twin.drive(Command(to_twist(action, PROFILE.base), twin.now()))
        twin.wait(twin.now() + PERIOD_S)
    assert len(set(turns)) <= 1


def test_between_two_boxes_it_takes_the_gap():
    gap = world(Box(x_m=3.0, y_m=0.75), Box(x_m=3.0, y_m=-0.75))
    states = drive(gap, "bang-bang", Episode(lateral_m=0.2), 5.0)
    assert not states[-1].collided
    assert all(abs(state.y_m) < 0.5 for state in states if 2.5 < state.x_m < 3.5)


def test_close_to_a_wall_of_boxes_it_turns_on_the_spot_instead_of_hitting_it():
    wall = world(*(Box(x_m=2.0, y_m=0.45 * k) for k in range(-3, 4)))
    states = drive(wall, "bang-bang", Episode(start_m=1.45), 6.0)
    assert not any(state.collided for state in states)


def test_where_the_line_does_not_matter_it_goes_straight_on():
    planner = Planner(Foresight(PROFILE, world()), "proportional", PERIOD_S, follow_line=False)
    twin = Twin(PROFILE, world())
    twin.reset(Episode(lateral_m=0.9))
    assert planner.plan(twin.state()) == pytest.approx((1.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("style", STYLES)
def test_sequences_cover_their_stages_and_stay_in_range(style):
    sequences = action_sequences(style, PERIOD_S)
    assert sequences.shape[1:] == (round(sum(STAGES_S) / PERIOD_S), 2)
    assert np.abs(sequences).max() == 1.0
    assert len(np.unique(sequences, axis=0)) == len(sequences)


def test_a_hand_turns_a_nimble_robot_no_faster_than_it_is_told():
    foresight = Foresight(PROFILE, ONE_BOX)
    twin = Twin(PROFILE, ONE_BOX)
    twin.reset(Episode(start_m=3.0))
    full, gentle = (
        Planner(foresight, "bang-bang", PERIOD_S, follow_line=True, steer=steer).plan(twin.state())[1]
        for steer in (1.0, 0.3)
    )
    assert abs(full) == 1.0
    assert abs(gentle) == pytest.approx(0.3)


@pytest.mark.parametrize(("lateral_m", "yaw_rad"), [(0.1, 0.0), (-0.2, 0.5)])
def test_a_robot_that_its_field_holds_before_a_box_is_turned_until_it_gets_past(lateral_m, yaw_rad):
    slow = small_pictures(load_profile("rosbot2"))
    planner = Planner(Foresight(slow, ONE_BOX), "bang-bang", slow.period_s, follow_line=True, steer=0.3)
    twin = Twin(slow, ONE_BOX)
    with govern(twin) as robot:
        twin.reset(Episode(start_m=BOX_M - 0.38, lateral_m=lateral_m, yaw_rad=yaw_rad))
        robot.read()
        robot.drive(Command(STOP, robot.now()))
        while (state := twin.state()).progress_m < BOX_M + 0.3:
            assert state.stamp_s < 40.0
            robot.read()
            robot.drive(Command(to_twist(planner.plan(state), slow.base), robot.now()))
            robot.wait(robot.now() + slow.period_s)
        assert not twin.state().collided
