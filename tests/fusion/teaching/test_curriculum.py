"""What an expert is trained on, lap by lap."""

import numpy as np
import pytest

from lira.fusion.teaching.curriculum import APART_M, LEAST, Anew, curriculum
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.layout import build

KINDS = ("camera", "lidar")


@pytest.mark.parametrize("kind", KINDS)
def test_every_lap_and_every_proof_is_driven_elsewhere_and_the_same_seed_repeats_them(kind):
    course = curriculum(kind, "line")
    anew = Anew(course, seed=1)
    laps = [anew.taught(1), anew.taught(2), *anew.proven(1), *anew.proven(2)]
    assert len(laps) == 2 + 2 * course.proofs
    episodes = [drive.episode for lap in laps for drive in lap]
    assert len(set(episodes)) == len(episodes) == len(laps) * len(course.drives)
    assert Anew(course, seed=1).taught(2) == anew.taught(2)
    assert Anew(course, seed=2).taught(2) != anew.taught(2)


@pytest.mark.parametrize("kind", KINDS)
def test_a_drive_begins_as_far_off_as_it_did_or_less_and_on_either_side(kind):
    course = curriculum(kind, "line")
    shares = set()
    for number in range(1, 9):
        for was, now in zip(course.drives, Anew(course, seed=0).taught(number), strict=True):
            assert 0.0 <= now.episode.start_m - was.episode.start_m < APART_M
            assert (now.limit_s, now.goal, now.final_lateral_m) == (was.limit_s, was.goal, was.final_lateral_m)
            pairs = ((was.episode.lateral_m, now.episode.lateral_m), (was.episode.yaw_rad, now.episode.yaw_rad))
            shares |= {round(after / before, 6) for before, after in pairs if before}
    assert all(LEAST <= abs(share) <= 1.0 for share in shares)
    assert min(shares) < 0.0 < max(shares)


def test_left_and_right_are_exchanged_together_so_that_who_drives_back_to_the_line_still_does():
    course = curriculum("camera", "line")
    towards = [
        now.episode
        for number in range(1, 5)
        for was, now in zip(course.drives, Anew(course, seed=0).taught(number), strict=True)
        if was.episode.lateral_m * was.episode.yaw_rad < 0.0
    ]
    assert len(towards) > 40
    assert all(episode.lateral_m * episode.yaw_rad < 0.0 for episode in towards)
    course = curriculum("lidar", "line")  # who sees no line is put to either side and askew to either
    starts = [drive.episode for number in range(1, 5) for drive in Anew(course, seed=0).taught(number)]
    assert {np.sign(each.lateral_m * each.yaw_rad) for each in starts} >= {-1.0, 1.0}


def test_every_forest_that_is_drawn_can_be_planted():
    world = load_world(curriculum("lidar", "line").world)
    for drive in Anew(curriculum("lidar", "line"), seed=3).taught(1):
        assert build(world, drive.episode.layout).blocks
