"""Things with a shape of their own: pybullet draws and scans them, a sketch says that it cannot."""

import sys

import numpy as np
import pytest

from lira.hal.errors import ConfigError
from lira.hal.profile import load_profile
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.foresight import Foresight
from lira.sim_backend.twin import Twin

SIM = load_profile("thesis-sim")
WORLD = """
description = "A pyramid"

[limits]
finish_m = 9.0
lost_m = 9.0

[[mesh]]
path = "things/{file}"
x_m = 2.0
y_m = {y_m}
yaw_deg = 90
scale = 2.0
gray = {gray}
"""
PYRAMID = """
v -0.25 -0.25 0
v 0.25 -0.25 0
v 0.25 0.25 0
v -0.25 0.25 0
v 0 0 0.5
f 1 2 5
f 2 3 5
f 3 4 5
f 4 1 5
f 1 3 2
f 1 4 3
"""
URDF = """<robot name="thing"><link name="base"><inertial><mass value="0"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<visual><geometry><box size="0.5 0.5 0.5"/></geometry></visual>
<collision><geometry><box size="0.5 0.5 0.5"/></geometry></collision></link></robot>"""
FILES = {"pyramid.obj": PYRAMID, "thing.urdf": URDF}


@pytest.fixture
def place(tmp_path):
    """Writes a world with one of the things, and returns its path."""

    def write(file, y_m=0.0, gray=40):
        (tmp_path / "things").mkdir(exist_ok=True)
        if file in FILES:
            (tmp_path / "things" / file).write_text(FILES[file])
        path = tmp_path / "mine.toml"
        path.write_text(WORLD.format(file=file, y_m=y_m, gray=gray))
        return str(path)

    return write


@pytest.mark.parametrize(("file", "front_m"), [("pyramid.obj", 2.0 - 0.5 * (1.0 - 0.26)), ("thing.urdf", 1.5)])
def test_it_is_seen_in_its_gray_and_scanned_where_it_stands(place, file, front_m):
    twin = Twin(SIM, place(file))
    twin.open()
    seen = twin.read()
    assert twin.renderer == "tiny"
    assert 40 in np.unique(seen.image.data)
    assert seen.scan.ranges[50] == pytest.approx(front_m, abs=0.01)
    twin.close()


def test_it_stands_where_the_file_says(place):
    twin = Twin(SIM, place("thing.urdf", y_m=1.5))
    twin.open()
    hit = np.flatnonzero(np.isfinite(twin.read().scan.ranges))
    assert hit.min() > 55
    twin.close()


def test_a_sketch_refuses_it_with_a_remedy(place, monkeypatch):
    path = place("thing.urdf")
    with pytest.raises(ConfigError, match="'mine' has meshes, which a sketch cannot draw"):
        Twin(SIM, path, renderer="sketch")
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(ConfigError, match="pybullet is not installed"):
        Twin(SIM, path)


def test_whoever_looks_ahead_takes_pybullet_for_it(place):
    foresight = Foresight(SIM, place("thing.urdf"))
    assert foresight.rollout(Twin(SIM, "line").state(), lambda _: (0.0, 0.0), 1, 0.2)
    foresight.close()


@pytest.mark.parametrize("file", ["missing.obj", "picture.png", "two\nlines"])
def test_a_path_that_is_no_mesh_is_named(place, file):
    with pytest.raises(ConfigError, match=r"mine\.toml"):
        load_world(place(file.replace("\n", "\\n")))


def test_a_file_that_is_no_mesh_is_named(place, monkeypatch):
    monkeypatch.setitem(FILES, "broken.urdf", "<robot")
    with pytest.raises(ConfigError, match=r"pybullet cannot read .*broken\.urdf"):
        Twin(SIM, place("broken.urdf")).open()
