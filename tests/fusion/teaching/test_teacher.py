"""The scripted teacher: when it takes control and lets go, in a made-up future, and that nothing is hit in a twin."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from lira.fusion.control import to_twist
from lira.fusion.methods.base import AsTaught, Choice, Proposal
from lira.fusion.preprocess import Features
from lira.fusion.teaching.teacher import PERFECT, SKILLED, ScriptedTeacher, TeacherSettings
from lira.hal.messages import Call, Command, CourseState, Episode
from lira.hal.profile import load_profile
from lira.sim_backend.foresight import Foresight
from lira.sim_backend.twin import Twin
from lira.sim_backend.world import Box, Limits, Line, Piece, World

PROFILE = load_profile("thesis-sim")
PERIOD_S = PROFILE.period_s
FEATURES = Features(scan=np.zeros(101, np.float32), image=np.zeros((32, 32), np.float32))
QUIET = Proposal(FEATURES, Choice("novice", (1.0, 0.0)))
CALLED = Proposal(FEATURES, Choice("novice", (1.0, 0.0), call=Call.FEEDBACK))
SURE = {"delay_sigma": 0.0, "gain_sigma": 0.0, "wrong_direction": 0.0, "missed": 0.0}


def straight(features):
    return 1.0, 0.0


@dataclass
class Futures:
    x_m: np.ndarray
    y_m: np.ndarray
    clearance_m: np.ndarray
    lateral_m: np.ndarray
    heading_error_rad: np.ndarray
    progress_m: np.ndarray


class Crystal:
    """A foresight in which `danger` says how it ends, and a left turn is always the best way out."""

    def __init__(self):
        self.danger, self.layouts, self.rollouts = False, [], 0

    def set_layout(self, layout):
        self.layouts.append(layout)

    def rollout(self, state, policy, steps, period_s, ends, first=None):
        self.rollouts += 1
        return [replace(state, x_m=state.x_m + 0.2, collided=self.danger)]

    def imagine(self, state, actions, period_s):
        lateral = 3.0 - np.cumsum(actions[:, :, 1], axis=1) * period_s
        x_m = state.x_m + np.cumsum(actions[:, :, 0], axis=1) * period_s
        none = np.zeros(lateral.shape)
        return Futures(x_m, none, np.full(lateral.shape, 1.0), lateral, none, none)


def at(step):
    """Return the truth in the middle of nowhere, so many steps after the start."""
    return CourseState(step * PERIOD_S, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, clearance_m=1.0)


class Straight(Crystal):
    """A foresight in which every policy drives straight on from the origin's line; it notes what is asked of it."""

    def __init__(self):
        super().__init__()
        self.asked = []

    def rollout(self, state, policy, steps, period_s, ends, first=None):
        self.asked.append((state.x_m, steps, first is not None))
        return [replace(state, x_m=state.x_m + period_s * k, linear_m_s=1.0) for k in range(1, steps + 1)]


@pytest.fixture
def crystal():
    return Crystal()


def teacher(crystal, seed=0, **settings):
    made = ScriptedTeacher(crystal, PROFILE, TeacherSettings(**SURE | settings), seed)
    made.reset(4)
    return made


def drive(hand, crystal, dangers, proposal=QUIET):
    """Return whether it has control at each step, with danger where `dangers` has an x."""
    held = []
    for step, mark in enumerate(dangers):
        crystal.danger = mark == "x"
        held.append(hand.act(at(step), proposal, straight) is not None)
    return "".join("H" if each else "-" for each in held)


def test_what_was_foreseen_and_came_true_is_not_looked_at_again():
    future, horizon = Straight(), 8
    hand = teacher(future)
    for step in range(3):
        hand.act(replace(at(0), x_m=PERIOD_S * step + 1e-9), QUIET, straight)
    whole, *rest = future.asked
    assert whole == (1e-9, horizon, True)
    assert [(steps, first) for _, steps, first in rest] == [(1, False)] * 2  # what was beyond the horizon before


@pytest.mark.parametrize("change", [{"x_m": 0.201}, {"yaw_rad": 0.001}, {"linear_m_s": 0.9}, {"progress_m": 0.1}])
def test_a_robot_that_is_not_where_it_was_foreseen_is_looked_at_anew(change):
    future = Straight()
    hand = teacher(future)
    hand.act(at(0), QUIET, straight)
    hand.act(replace(at(0), **{"x_m": 0.2} | change), QUIET, straight)
    assert [steps for _, steps, _ in future.asked] == [8, 8]


class TestSlowedDown:
    """A robot that calls for feedback drives slowly the way that was foreseen."""

    def asked(self, *drives, policy=straight):
        future = Straight()
        hand = teacher(future)
        hand.act(at(0), CALLED, straight)
        for step, (x_m, linear_m_s) in enumerate(drives, start=1):
            hand.act(replace(at(step), x_m=x_m, linear_m_s=linear_m_s), CALLED, policy)
        return [x_m for x_m, _, _ in future.asked]

    def test_it_is_looked_at_anew_where_it_would_have_decided_anew(self):
        assert self.asked((0.06, 0.3), (0.12, 0.3), (0.18, 0.3), (0.24, 0.3), (0.30, 0.3)) == [0.0, 0.24]

    def test_one_that_came_to_a_stand_on_its_way_is_looked_at_again_and_again(self):
        assert self.asked(*[(0.06, 0.0)] * 12) == [0.0, 0.06, 0.06]

    def test_one_that_is_as_fast_as_was_foreseen_is_looked_at_wherever_else_it_is(self):
        assert self.asked((0.1, 1.0)) == [0.0, 0.1]

    def test_another_policy_is_looked_at_at_once(self):
        assert self.asked((0.06, 0.3), policy=lambda _: (1.0, 0.0)) == [0.0, 0.06]

    def test_what_a_hand_does_was_not_foreseen(self):
        future = Straight()
        hand = teacher(future, delay_s=0.0, stray_m=-1.0, free_m=0.0)  # everything is a danger
        assert hand.act(at(0), QUIET, straight) is not None
        hand.act(replace(at(1), x_m=0.06, linear_m_s=0.3), QUIET, straight)
        assert [x_m for x_m, _, _ in future.asked] == [0.0, 0.06]

    def test_a_danger_that_was_foreseen_lasts_until_it_is_looked_at_anew(self, crystal):
        hand = teacher(crystal, called_delay_s=0.3)
        crystal.danger = True
        assert hand.act(at(0), CALLED, straight) is None
        crystal.danger = False
        assert hand.act(replace(at(1), x_m=0.06, linear_m_s=0.3), CALLED, straight) is None
        assert hand.act(replace(at(2), x_m=0.12, linear_m_s=0.3), CALLED, straight) is not None
        assert crystal.rollouts == 1


def test_another_policy_and_one_that_has_learned_are_looked_at_anew():
    future = Straight()
    hand = teacher(future)
    novice = [AsTaught(straight, 1), AsTaught(straight, 1), AsTaught(straight, 2), lambda _: (1.0, 0.0)]
    for step, policy in enumerate(novice):
        hand.act(replace(at(0), x_m=0.2 * step), QUIET, policy)
    assert [steps for _, steps, _ in future.asked] == [8, 1, 8, 8]


def test_a_new_episode_begins_with_a_look():
    future = Straight()
    hand = teacher(future)
    hand.act(at(0), QUIET, straight)
    hand.reset(5)
    hand.act(replace(at(0), x_m=0.2), QUIET, straight)
    assert [steps for _, steps, _ in future.asked] == [8, 8]


def test_a_perfect_teacher_takes_over_at_once_and_lets_go_after_three_safe_steps(crystal):
    hand = ScriptedTeacher(crystal, PROFILE, PERFECT, seed=0)
    assert drive(hand, crystal, "..xx......") == "--HHHH----"


def test_a_danger_in_between_starts_the_count_anew(crystal):
    hand = ScriptedTeacher(crystal, PROFILE, PERFECT, seed=0)
    assert drive(hand, crystal, "x..x..x....") == "HHHHHHHHH--"


def test_it_lets_go_at_once_when_the_method_asks_for_the_wheel(crystal):
    hand = teacher(crystal, delay_s=0.0)
    assert drive(hand, crystal, "xx") == "HH"
    assert drive(hand, crystal, "x", replace(QUIET, relieves=True)) == "-"
    assert drive(hand, crystal, "x") == "H"  # and takes over again if that went wrong


def test_a_hand_that_does_not_get_anywhere_gives_up_and_has_to_see_the_danger_anew(crystal):
    held = drive(teacher(crystal, delay_s=0.0, longest_s=2.0), crystal, "x" * 30)
    assert max(map(len, held.split("-"))) == 10  # steps of 0.2 s
    assert held.startswith("H" * 10 + "-H")


def test_safe_steps_are_a_setting(crystal):
    assert drive(teacher(crystal, delay_s=0.0, safe_steps=1), crystal, "xx...") == "HH---"


def test_a_human_reacts_after_a_while_and_sooner_when_called(crystal):
    assert drive(teacher(crystal, delay_s=0.6, called_delay_s=0.2), crystal, "xxxxxx") == "---HHH"
    assert drive(teacher(crystal, delay_s=0.6, called_delay_s=0.2), crystal, "xxxxxx", CALLED) == "-HHHHH"


def test_a_danger_that_passes_before_the_hand_moves_is_left_alone(crystal):
    assert drive(teacher(crystal, delay_s=0.6), crystal, "xx.xx.xxxx") == "---------H"


class Late(Straight):
    """A foresight in which who goes straight on collides beyond `end_m`, who turns never, and who is slow at once."""

    def __init__(self, end_m):
        super().__init__()
        self.end_m = end_m

    def rollout(self, state, policy, steps, period_s, ends, first=None):
        linear, angular = first
        drive = super().rollout(state, policy, steps, period_s, ends, first)
        end_m = 0.0 if linear < 1.0 else self.end_m if angular == 0.0 else math.inf
        return [replace(each, collided=each.x_m > end_m) for each in drive]


@pytest.mark.parametrize(("end_m", "given"), [(1.0, "lidar"), (4.0, "camera")])
def test_control_is_given_to_the_first_expert_that_does_well(end_m, given):
    experts = {"camera": straight, "lidar": lambda _: (1.0, 0.1)}
    only = {"camera": straight}
    answers = [
        ScriptedTeacher(Late(end_m), PROFILE, PERFECT, 0).act(at(0), QUIET, lambda _: (0.9, 0.0), offers)
        for offers in (experts, only)
    ]
    assert answers[0] == given
    assert (answers[1] == "camera") == (given == "camera")  # else it drives itself


def test_a_missed_danger_is_seen_late_and_so_a_robot_that_stands_and_asks_does_not_stand_for_ever(crystal):
    hand = teacher(crystal, delay_s=0.0, missed=1.0, notices_s=2.0)
    assert drive(hand, crystal, "x" * 9 + ".." + "x" * 12) == "-" * 21 + "HH"


def test_the_delay_is_log_normal_around_its_median(crystal):
    waits = []
    for seed in range(200):
        held = drive(teacher(crystal, seed, delay_s=0.6, delay_sigma=0.3), crystal, "x" * 12)
        waits.append(held.index("H") * PERIOD_S)
    assert np.median(waits) == pytest.approx(0.6, abs=1.1 * PERIOD_S)
    assert len(set(waits)) > 3


def test_a_confused_human_turns_the_wrong_way_for_two_steps(crystal):
    crystal.danger = True
    right, confused = teacher(crystal, delay_s=0.0), teacher(crystal, delay_s=0.0, wrong_direction=1.0)
    turns = [[hand.act(at(step), QUIET, straight)[1] for step in range(4)] for hand in (right, confused)]
    assert turns == [[1.0] * 4, [-1.0, -1.0, 1.0, 1.0]]


def test_over_and_understeer_last_for_an_intervention_and_stay_in_range(crystal):
    crystal.danger = True
    turns = []
    for seed in range(40):
        hand = teacher(crystal, seed, delay_s=0.0, gain_sigma=0.5)
        first, second = (hand.act(at(step), QUIET, straight)[1] for step in range(2))
        assert first == second
        turns.append(first)
    assert min(turns) < 0.7
    assert max(turns) == 1.0


def test_the_initial_demonstration_is_driven_without_faults(crystal):
    hand = teacher(crystal, wrong_direction=1.0, missed=1.0, gain_sigma=1.0)
    assert [hand.act(at(step), QUIET, None) for step in range(3)] == [(1.0, 1.0)] * 3
    assert crystal.rollouts == 0


def test_a_new_episode_begins_with_hands_off_and_the_layout_in_mind(crystal):
    hand = teacher(crystal, delay_s=0.0)
    assert drive(hand, crystal, "xx") == "HH"
    hand.reset(9)
    assert drive(hand, crystal, "..") == "--"
    assert crystal.layouts == [4, 9]


def test_one_seed_is_one_teacher(crystal):
    script = "..xxxx.....xxxx....xxxxxxx......"
    human = TeacherSettings()
    drives = [drive(ScriptedTeacher(crystal, PROFILE, human, seed), crystal, script) for seed in (1, 1, 2, 3, 4)]
    assert drives[0] == drives[1]
    assert len(set(drives)) > 1


WORLD = World(
    description="a straight line with a box on it",
    line=Line(pieces=(Piece(straight_m=20.0),)),
    box=(Box(x_m=4.0, y_m=0.05),),
    limits=Limits(lost_m=1.5, finish_m=10.0),
)


@pytest.mark.parametrize(
    ("lateral_m", "yaw_rad", "policy", "takes"),
    [
        (0.0, 0.0, straight, False),
        (0.6, 0.0, straight, True),  # beside the line, with nothing to drive around
        (0.3, 0.0, straight, False),
        (0.0, 0.0, lambda _: (0.1, 0.0), True),  # nothing will happen to it, and nothing will come of it
        (0.0, 3.0, straight, True),  # back to where it came from
    ],
)
def test_a_robot_that_strays_from_a_free_line_turns_back_or_stands_is_in_need_of_help(
    lateral_m, yaw_rad, policy, takes
):
    foresight = Foresight(PROFILE, WORLD)
    hand = ScriptedTeacher(foresight, PROFILE, PERFECT, seed=0)
    hand.reset(0)
    twin = Twin(PROFILE, WORLD)
    twin.reset(Episode(start_m=1.0, lateral_m=lateral_m, yaw_rad=yaw_rad))
    proposal = replace(QUIET, choice=Choice("novice", policy(FEATURES)))
    action = hand.act(twin.state(), proposal, policy)
    foresight.close()
    assert (action is not None) == takes


@pytest.mark.parametrize(("yaw_rad", "takes"), [(1.5, False), (2.1, True)])
def test_a_slow_robot_that_turns_back_is_in_need_of_help_although_it_does_not_get_far(yaw_rad, takes):
    slow = load_profile("rosbot2")
    foresight = Foresight(slow, WORLD)
    hand = ScriptedTeacher(foresight, slow, PERFECT, seed=0)
    hand.reset(0)
    twin = Twin(slow, WORLD)
    twin.reset(Episode(start_m=1.0, lateral_m=-0.3, yaw_rad=yaw_rad))
    action = hand.act(twin.state(), QUIET, lambda _: (1.0, 0.0))
    foresight.close()
    assert (action is not None) == takes


@pytest.mark.parametrize("settings", [PERFECT, SKILLED])
def test_in_the_twin_it_takes_over_before_the_box_drives_around_it_and_hands_back(settings):
    foresight = Foresight(PROFILE, WORLD)
    hand = ScriptedTeacher(foresight, PROFILE, settings, seed=0)
    hand.reset(0)
    twin = Twin(PROFILE, WORLD)
    held, nearest_m = [], np.inf
    for _ in range(60):
        state = twin.state()
        action = hand.act(state, QUIET, straight)
        held.append(action is not None)
        # Left alone the policy goes straight on, along its line.
        twist = to_twist(action or (1.0, float(np.clip(-2.0 * state.yaw_rad, -1, 1))), PROFILE.base)
        twin.drive(Command(twist, twin.now()))
        twin.wait(twin.now() + PERIOD_S)
        nearest_m = min(nearest_m, twin.state().clearance_m)
    foresight.close()
    state = twin.state()
    assert not state.collided
    assert not state.lost
    assert state.progress_m > 8.0
    assert nearest_m > 0.0
    assert not held[0]
    assert any(held)
    assert not held[-1]
