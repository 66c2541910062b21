"""Looking ahead: the imagined robot's small picture, and what is not looked at."""

import numpy as np
import pytest
from fresh import python

from lira.fusion.control import to_twist
from lira.fusion.experts.load import load_policy
from lira.fusion.modalities.image import gray_image
from lira.fusion.preprocess import Preprocessor
from lira.hal.messages import STOP, Command, Episode
from lira.hal.profile import load_profile
from lira.hal.safety.governed import govern
from lira.hal.testing import small_pictures
from lira.sim_backend.camera import PinholeCamera
from lira.sim_backend.foresight import Foresight, with_small_camera
from lira.sim_backend.lidar import RayLidar
from lira.sim_backend.twin import Twin
from lira.sim_backend.world import Box, Limits, Line, Piece, World


@pytest.mark.parametrize("world", ["corridor", "garden"])
def test_a_small_picture_looks_like_the_one_it_stands_for(world):
    profile = load_profile("rosbot2")
    px = profile.features.image_px
    seen = []
    for each in (profile, with_small_camera(profile)):
        twin = Twin(each, world, renderer="tiny")
        twin.open()
        twin.reset(Episode(start_m=1.5))
        seen.append(gray_image(twin.read().image, px))
        twin.close()
    difference = np.abs(seen[0] - seen[1])
    assert difference.mean() < 0.01
    assert seen[0].std() > 0.05  # there is something to see


def test_a_camera_that_is_small_already_is_left_alone():
    profile = load_profile("thesis-sim")
    assert with_small_camera(profile) is profile


@pytest.mark.parametrize(
    ("aside_m", "turn", "box_deg"),
    [(0.0, 0.0, 0.0), (0.0, 0.1, 0.0), (0.18, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.0, 45.0), (0.24, 0.0, 30.0)],
)
def test_the_protective_field_works_in_what_is_foreseen_as_on_the_robot(aside_m, turn, box_deg):
    profile, steps = small_pictures(load_profile("rosbot2")), 16
    world = World(
        description="a box on the way",
        box=(Box(x_m=1.0, y_m=0.0, yaw_deg=box_deg, length_m=0.3, width_m=0.3),),
        line=Line(pieces=(Piece(straight_m=5.0),)),
        limits=Limits(lost_m=3.0, finish_m=4.0),
    )
    foresight = Foresight(profile, world)
    with govern(Twin(profile, world)) as robot:
        robot._robot.reset(Episode(start_m=0.35, lateral_m=aside_m))
        began, period_s = robot._robot.state(), profile.period_s
        robot.read()
        robot.drive(Command(STOP, robot.now()))
        driven = []
        for _ in range(steps):
            robot.read()
            robot.drive(Command(to_twist((1.0, turn), profile.base), robot.now()))
            robot.wait(robot.now() + period_s)
            driven.append(robot._robot.state().x_m)
    imagined = foresight.imagine(began, np.tile((1.0, turn), (1, steps, 1)), period_s)
    foreseen = foresight.rollout(began, lambda _: (1.0, turn), steps, period_s)
    assert imagined.x_m[0] == pytest.approx(driven, abs=0.03)  # it looks ten times a second, not fifty
    assert [state.x_m for state in foreseen] == pytest.approx(driven, abs=0.05)
    foresight.close()


@pytest.mark.parametrize("turn", [-0.6, 0.0, 0.6])
def test_a_look_ahead_that_ends_is_the_beginning_of_a_whole_one(turn):
    """What the teacher does not look at any more changes nothing of what it has seen."""
    profile = load_profile("thesis-sim")
    twin, foresight = Twin(profile, "line-obstacles", layout=3), Foresight(profile, "line-obstacles", 3)
    ended = 0
    for start_m in np.arange(0.0, 40.0, 1.5).tolist():
        twin.reset(Episode(3, start_m=start_m))
        state = twin.state()
        whole = foresight.rollout(state, lambda _: (1.0, turn), 8, 0.2)
        short = foresight.rollout(state, lambda _: (1.0, turn), 8, 0.2, lambda each: each.clearance_m < 0.3)
        near = [number for number, each in enumerate(whole) if each.clearance_m < 0.3]
        expected = whole[: near[0] + 1] if near else whole
        assert len(short) == len(expected)
        for one, other in zip(short, expected, strict=True):  # but for the rounding of a clock that goes on
            assert (one.x_m, one.y_m, one.clearance_m) == pytest.approx((other.x_m, other.y_m, other.clearance_m))
            assert (one.collided, one.lost) == (other.collided, other.lost)
        ended += len(short) < len(whole)
    assert ended
    foresight.close()


def test_a_look_ahead_goes_on_from_where_one_has_ended():
    profile = load_profile("thesis-sim")
    twin, foresight = Twin(profile, "line-obstacles", layout=3), Foresight(profile, "line-obstacles", 3)

    def towards_the_light(look):
        seen = look("image").data
        return 1.0, float(np.clip(seen[:, :16].mean() / seen[:, 16:].mean() - 1.0, -1.0, 1.0))

    twin.reset(Episode(3, start_m=4.0, yaw_rad=0.1))
    whole = foresight.rollout(twin.state(), towards_the_light, 8, 0.2)
    twin.open()
    first = towards_the_light(twin.sense)  # what is done with what is seen already
    begun = foresight.rollout(twin.state(), towards_the_light, 3, 0.2, first=first)
    for one, other in zip([*begun, *foresight.rollout(begun[-1], towards_the_light, 5, 0.2)], whole, strict=True):
        assert (one.x_m, one.y_m, one.yaw_rad) == pytest.approx((other.x_m, other.y_m, other.yaw_rad), abs=1e-9)
        assert (one.progress_m, one.clearance_m) == pytest.approx((other.progress_m, other.clearance_m), abs=1e-9)
    foresight.close()
    twin.close()


def test_what_nobody_looks_at_is_not_measured(monkeypatch):
    profile, drawn, scanned = load_profile("thesis-sim"), [], []
    render, scan = PinholeCamera.render, RayLidar.scan
    monkeypatch.setattr(PinholeCamera, "render", lambda self, pose: drawn.append(1) or render(self, pose))
    monkeypatch.setattr(RayLidar, "scan", lambda self, *words: scanned.append(1) or scan(self, *words))
    twin, foresight = Twin(profile, "line-obstacles"), Foresight(profile, "line-obstacles")
    lidar, both = load_policy("lidar-expert", profile).act, Preprocessor(profile)
    foresight.rollout(twin.state(), lambda look: lidar(both.looking(look)), 4, 0.2)
    assert (len(drawn), len(scanned)) == (0, 4)
    foresight.rollout(twin.state(), lambda look: (0.5, float(both.looking(look).image.mean())), 3, 0.2)
    assert (len(drawn), len(scanned)) == (3, 4)
    foresight.close()


def test_nothing_of_pybullet_is_loaded_for_a_sketch():
    code = (
        "import sys; from lira.hal.profile import load_profile; from lira.sim_backend.twin import Twin\n"
        "t = Twin(load_profile('thesis-sim'), 'race', renderer='sketch'); t.open(); t.read(); t.close()\n"
        "sys.exit('pybullet' in sys.modules)"
    )
    assert python(code).returncode == 0
