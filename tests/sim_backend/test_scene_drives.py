"""The experts that come with the project drive the sketch as they drive pybullet's floor."""

import pytest

from lira.fusion.experts.load import load_policy
from lira.fusion.experts.tasks import TASKS
from lira.fusion.preprocess import Preprocessor
from lira.fusion.teaching.curriculum import curriculum
from lira.hal.messages import Command, Twist
from lira.hal.profile import load_profile
from lira.sim_backend.foresight import with_small_camera
from lira.sim_backend.twin import Twin

# Drives of an expert's own curriculum: few enough for pybullet, and each for a part of it.
DRIVES = 2
LIMIT_S = 12.0


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("kind", ["camera", "lidar"])
def test_an_expert_drives_both_scenes_alike(kind, task):
    profile = with_small_camera(load_profile(TASKS[task].profile))
    course = curriculum(kind, task)
    expert, look = load_policy(f"{kind}-expert", profile, task), Preprocessor(profile)
    base = profile.base
    for drive in course.drives[:DRIVES]:
        ends = []
        for renderer in ("sketch", "tiny"):
            twin = Twin(profile, course.world, layout=drive.episode.layout, renderer=renderer)
            twin.open()
            twin.reset(drive.episode)
            while twin.now() < min(drive.limit_s, LIMIT_S) and not twin.state().finished:
                linear, angular = expert.act(look(twin.read()))
                twin.drive(Command(Twist(linear * base.max_linear_m_s, angular * base.max_angular_rad_s), twin.now()))
                twin.wait(twin.now() + profile.period_s)
            ends.append(twin.state())
            twin.close()
        ours, theirs = ends
        assert not theirs.collided
        assert (ours.collided, ours.lost, ours.finished) == (theirs.collided, theirs.lost, theirs.finished)
        assert (ours.x_m, ours.y_m) == pytest.approx((theirs.x_m, theirs.y_m), abs=0.2)
