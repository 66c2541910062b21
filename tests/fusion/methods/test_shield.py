"""The shield: what it leaves alone, what it turns, and where it stands."""

import math
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from lira.fusion.methods.base import STAND, Alone, Around, Method
from lira.fusion.methods.shield import HORIZON_S, MARGINS_M, STEPS, Shield, Shielded, arcs
from lira.fusion.methods.stop_and_ask import Doubtful
from lira.fusion.preprocess import Features
from lira.hal.errors import ConfigError
from lira.hal.messages import Call, Phase
from lira.hal.profile import load_profile

SIM, REAL = load_profile("thesis-sim"), load_profile("rosbot2")
IMAGE = np.full((32, 32), 0.5, np.float32)


def scan_of(profile, *boxes):
    """What a lidar at the origin sees of upright cylinders (x_m, y_m, radius_m), as the networks see it."""
    shape = profile.features
    angles = (np.arange(shape.bins) + 0.5) * shape.fov_rad / shape.bins - shape.fov_rad / 2
    nearest = np.full(shape.bins, np.inf)
    for x_m, y_m, radius_m in boxes:
        ahead_m = x_m - profile.lidar.x_m
        along = ahead_m * np.cos(angles) + y_m * np.sin(angles)
        across = ahead_m * np.sin(angles) - y_m * np.cos(angles)
        hit = (np.abs(across) <= radius_m) & (along > 0.0)
        depth = np.sqrt(np.clip(radius_m**2 - across**2, 0.0, None))
        nearest = np.where(hit, np.minimum(nearest, along - depth), nearest)
    return np.minimum(nearest / shape.max_range_m, 1.0).astype(np.float32)


def random_scan(profile, random):
    reach_m = HORIZON_S * profile.base.max_linear_m_s
    places = [0.3 + random.uniform(0.0, reach_m, 3), random.uniform(-reach_m, reach_m, 3), random.uniform(0.05, 0.2, 3)]
    return scan_of(profile, *zip(*places, strict=True))


def nearest_m(profile, action, scan):
    """How near the robot comes to what was seen, reckoned step by step, beyond what it is near already."""
    points = Shield(profile).points(scan)
    x_m = y_m = yaw = 0.0
    least_m, dt = math.inf, 0.001
    for _ in range(round(HORIZON_S / dt)):
        yaw += action[1] * profile.base.max_angular_rad_s * dt
        x_m += action[0] * profile.base.max_linear_m_s * math.cos(yaw) * dt
        y_m += action[0] * profile.base.max_linear_m_s * math.sin(yaw) * dt
        away = np.hypot(points[:, 0] - x_m, points[:, 1] - y_m)
        least_m = min(least_m, float(np.where(away < np.linalg.norm(points, axis=1), away, np.inf).min(initial=np.inf)))
    return least_m


def test_an_arc_is_that_of_a_circle_and_a_turn_of_zero_goes_straight():
    q = arcs(0.5, np.array([0.0, 2.0]))
    t = np.linspace(HORIZON_S / STEPS, HORIZON_S, STEPS)
    assert q[0] == pytest.approx(np.stack([0.5 * t, 0 * t], axis=1))
    assert q[1] == pytest.approx(np.stack([0.25 * np.sin(2 * t), 0.25 * (1 - np.cos(2 * t))], axis=1))


@pytest.mark.parametrize("profile", [SIM, REAL], ids=lambda profile: profile.name)
@pytest.mark.parametrize("action", [(1.0, 0.0), (1.0, -0.7), (0.3, 1.0), (0.0, 1.0), STAND, (-1.0, 0.2)])
def test_on_free_ground_nothing_changes(profile, action):
    assert Shield(profile)(action, scan_of(profile)) == action


def test_before_a_box_it_turns_to_the_nearer_free_side_and_no_more_than_it_must():
    shield, scan = Shield(SIM), scan_of(SIM, (1.1, 0.1, 0.1))
    linear, angular = shield((1.0, 0.0), scan)
    assert linear == 1.0
    assert -1.0 < angular < 0.0
    assert not shield.clear(shield.points(scan), 1.0, np.array([angular + 0.05]), MARGINS_M[0])[0]
    assert shield((1.0, -0.9), scan) == (1.0, -0.9)  # that side was meant anyway


def test_left_and_right_are_the_same_to_it():
    scan = scan_of(SIM, (0.9, 0.1, 0.15), (0.7, -0.5, 0.1))
    linear, angular = Shield(SIM)((1.0, 0.2), scan)
    mirrored = Shield(SIM)((1.0, -0.2), scan[::-1])
    assert mirrored == pytest.approx((linear, -angular))


def test_before_a_wall_it_stands():
    wall = scan_of(SIM, *((0.5, 0.1 * k, 0.1) for k in range(-20, 21)))
    assert Shield(SIM)((1.0, 0.3), wall) == STAND
    assert Shield(SIM)((0.0, 1.0), wall) == (0.0, 1.0)  # a turn on the spot brings nothing nearer


def test_in_a_gap_too_narrow_for_the_margin_it_goes_on_between_and_touches_nothing():
    gap = scan_of(SIM, *((0.1 * k, side * 0.3, 0.08) for k in range(1, 12) for side in (-1, 1)))
    assert Shield(SIM)((1.0, 0.0), gap) == (1.0, 0.0)
    assert abs(Shield(SIM)((1.0, 0.5), gap)[1]) < 0.2


def test_it_keeps_the_margin_where_it_can():
    shield, scan = Shield(SIM), scan_of(SIM, (1.1, 0.1, 0.1))
    _, angular = shield((1.0, 0.0), scan)
    assert shield.clear(shield.points(scan), 1.0, np.array([angular]), MARGINS_M[0])[0]


def test_what_is_too_close_for_the_lidar_is_in_the_way():
    scan = scan_of(SIM)
    scan[45:56] = 0.0
    assert Shield(SIM)((1.0, 0.0), scan) == STAND


@pytest.mark.parametrize("profile", [SIM, REAL], ids=lambda profile: profile.name)
def test_what_it_lets_through_comes_near_nothing_and_what_it_changes_would_have(profile):
    random = np.random.default_rng(0)
    radius_m = math.hypot(profile.base.length_m, profile.base.width_m) / 2
    kept = turned = 0
    for _ in range(60):
        scan, action = random_scan(profile, random), (1.0, float(random.uniform(-1.0, 1.0)))
        answer = Shield(profile)(action, scan)
        if answer == STAND:
            continue
        near = np.linalg.norm(Shield(profile).points(scan), axis=1).min(initial=np.inf)
        assert nearest_m(profile, answer, scan) >= min(radius_m, near) - 0.01
        kept, turned = kept + (answer == action), turned + (answer != action)
    assert kept > 5
    assert turned > 5


def test_a_robot_without_a_lidar_has_none():
    features = msgspec.structs.replace(SIM.features, inputs=("image",))
    with pytest.raises(ConfigError, match="no lidar"):
        Shield(msgspec.structs.replace(SIM, features=features))


BOX, FREE = (Features(scan=scan, image=IMAGE) for scan in (scan_of(SIM, (0.9, 0.1, 0.15)), scan_of(SIM)))
WALL = Features(scan=scan_of(SIM, *((0.5, 0.1 * k, 0.1) for k in range(-20, 21))), image=IMAGE)


class TestShielded:
    def test_a_step_that_it_changed_says_so_and_what_the_novice_wanted(self):
        method = Shielded(Alone("novice", lambda _: (1.0, 0.0)), Shield(SIM))
        free, box = method.propose(FREE), method.propose(BOX)
        assert (free.choice.driver, free.command) == ("novice", (1.0, 0.0))
        assert (box.choice.driver, box.novice) == ("shield", (1.0, 0.0))
        assert box.command[1] < 0.0
        assert method.policy("shield")(BOX) == method.policy("novice")(BOX) == box.command
        assert method.policy("novice")(FREE) == (1.0, 0.0)

    def test_several_robots_are_shielded_each_by_what_it_sees(self):
        together = Alone("novice", lambda _: (1.0, 0.0), lambda seen: [(1.0, 0.0)] * len(seen))
        method, views = Shielded(together, Shield(SIM)), [FREE, BOX, WALL]
        assert method.drives_several
        assert [each.choice for each in method.propose_all(views)] == [method.propose(each).choice for each in views]
        assert not Shielded(Alone("novice", lambda _: (1.0, 0.0)), Shield(SIM)).drives_several

    def test_where_no_turn_is_clear_it_stands_and_calls(self):
        proposal = Shielded(Alone("novice", lambda _: (1.0, 0.0)), Shield(SIM)).propose(WALL)
        assert (proposal.command, proposal.choice.call) == (STAND, Call.FEEDBACK)

    def test_one_that_stands_in_doubt_stands(self):
        method = Shielded(Doubtful(lambda _: (1.0, 0.0), lambda _: True), Shield(SIM))
        proposal = method.propose(BOX)
        assert (proposal.choice.driver, proposal.command, proposal.choice.call) == ("novice", STAND, Call.FEEDBACK)

    def test_a_hand_is_no_business_of_it(self):
        method = Shielded(Alone("novice", lambda _: (1.0, 0.0)), Shield(SIM))
        lesson = method.learn(method.propose(BOX), (1.0, 1.0))
        assert (lesson.choice.driver, lesson.choice.action) == ("human", (1.0, 1.0))

    def test_it_passes_on_all_else(self):
        told = []
        inner = SimpleNamespace(
            novice="novice",
            experts=(),
            calls_alone=True,
            reset=lambda: told.append("reset"),
            close=lambda: told.append("close"),
        )
        inner.update = told.append
        method = Shielded(inner, Shield(SIM))
        method.reset()
        method.update(3.0)
        method.close()
        assert told == ["reset", 3.0, "close"]
        assert method.calls_alone
        passed_on = {"novice", "experts", "learns", "propose_all"}  # which follow from the others
        assert {name for name in vars(Method) if not name.startswith("_")} - set(vars(Around)) == passed_on

    def test_what_drives_without_a_teacher_is_behind_the_same_shield(self):
        alone = Shielded(Alone("novice", lambda _: (1.0, 0.0)), Shield(SIM)).alone(Phase.UNSEEN)
        assert alone.propose(BOX).choice.driver == "shield"
