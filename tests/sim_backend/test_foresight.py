"""The imagined robot's small picture is what the networks would see of the large one."""

import numpy as np
import pytest

from lira.fusion.modalities.image import gray_image
from lira.hal.messages import Episode
from lira.hal.profile import load_profile
from lira.sim_backend.foresight import with_small_camera
from lira.sim_backend.twin import Twin


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
