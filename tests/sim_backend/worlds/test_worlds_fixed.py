"""The shipped experts were trained on these floors: they must not change by a bit."""

import hashlib

import numpy as np

from lira.hal.profile import load_profile
from lira.sim_backend import drive
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.layout import build
from lira.sim_backend.sensors import Sensors

LAYOUT_HASH = "2e1c2e139533b7d3"
PICTURE_HASH = "d37148c6458a47b1"


def digest(data):
    return hashlib.sha256(data).hexdigest()[:16]


def test_the_boxes_of_a_layout_stand_where_they_always_stood():
    blocks = build(load_world("line-obstacles"), 3).blocks
    rows = [(b.x_m, b.y_m, b.yaw_rad, b.length_m, b.width_m, b.height_m, b.gray) for b in blocks]
    microns = np.rint(np.array(rows) * 1e6).astype(np.int64)
    assert digest(microns.tobytes()) == LAYOUT_HASH


def test_the_camera_sees_what_it_always_saw():
    sensors = Sensors(load_profile("thesis-sim"), build(load_world("line-obstacles"), 3), "tiny", 0)
    pictures = []
    for pose in ((0.0, 0.0, 0.0), (3.0, 0.2, 0.3), (8.0, -0.3, -0.2)):
        sensors.forget()
        pictures.append(sensors.read("camera", drive.motion(*pose), 0.0).data)
    sensors.close()
    assert digest(np.stack(pictures).tobytes()) == PICTURE_HASH
