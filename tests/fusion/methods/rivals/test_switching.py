import numpy as np
from taught import FEATURES

from lira.fusion.methods.base import Expert
from lira.fusion.methods.rivals.switching import Switching, SwitchingSettings
from lira.fusion.preprocess import Features
from lira.hal.messages import Call

CAMERA, LIDAR = (1.0, 0.1), (0.5, -0.8)


def seeing(nearest_m):
    scan = np.ones(101, np.float32)
    scan[40] = nearest_m / 4.0
    return Features(scan=scan, image=FEATURES.image)


def drivers(rule, *nearest_m):
    choices = [rule.propose(seeing(each)).choice for each in nearest_m]
    assert all(each.label is None and each.call is Call.NONE for each in choices)
    assert all(each.action == {"camera": CAMERA, "lidar": LIDAR}[each.driver] for each in choices)
    return [each.driver[0] for each in choices]


def make(steps=3):
    camera, lidar = Expert("camera", lambda _: CAMERA), Expert("lidar", lambda _: LIDAR)
    return Switching(camera, lidar, SwitchingSettings(near_m=1.0, steps=steps), max_range_m=4.0)


def test_the_lidar_expert_drives_for_a_preset_number_of_steps_once_something_is_near():
    assert drivers(make(), 2.0, 0.9, 2.0, 2.0, 2.0) == list("clllc")


def test_what_stays_near_starts_the_count_anew_and_the_limit_is_strict():
    assert drivers(make(), 0.9, 2.0, 0.9, 2.0, 2.0, 2.0) == list("lllllc")
    assert drivers(make(), 1.0, 1.1) == list("cc")


def test_a_new_episode_begins_with_the_camera():
    rule = make()
    assert drivers(rule, 0.5) == ["l"]
    rule.reset()
    assert drivers(rule, 2.0) == ["c"]
