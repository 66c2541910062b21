from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

from lira.hal.profile import load_profile
from lira.sim_backend.catalogue import known_worlds, load_world
from lira.sim_backend.course import Course
from lira.sim_backend.layout import build
from lira.tools.cli import main
from lira.tools.output.world_picture import FREE_M, LETTERS, OUTLINE, WIDE_PX, draw, from_above, view_poses

PICTURES = Path(__file__).parents[3] / "sim_backend" / "pictures"


def test_every_world_has_a_small_picture():
    pictures = {path.stem: path.stat().st_size for path in PICTURES.glob("*.png")}
    assert set(pictures) == set(known_worlds())
    assert max(pictures.values()) < 100_000


def test_the_verb_writes_a_picture(tmp_path, capsys):
    target = tmp_path / "out.png"
    assert main(["world", "line-obstacles", "--layout", "2", "--picture", str(target)]) == 0
    assert "world 'line-obstacles', layout 2, seen by thesis-sim" in capsys.readouterr().out
    picture = cv2.imread(str(target))
    assert picture.shape[1] == WIDE_PX
    expected = draw(build(load_world("line-obstacles"), 2), load_profile("thesis-sim"))
    assert (picture == expected).all()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["nosuch", "--picture", "a.png"], "unknown world 'nosuch'"),
        (["line", "--picture", "a.jpg"], "a.jpg is no .png file"),
        (["line", "--picture", "no/such/folder/a.png"], "cannot write no/such/folder/a.png: No such file"),
    ],
)
def test_a_mistake_is_one_line_and_its_remedy(tmp_path, monkeypatch, capsys, words, complaint):
    monkeypatch.chdir(tmp_path)
    assert main(["world", *words]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith(f"lira world: {complaint}")
    assert len(lines) == 2
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", known_worlds())
def test_the_camera_looks_from_places_with_room_around_them(name):
    course = Course(build(load_world(name)), 0.154)
    poses = view_poses(course)
    assert len(poses) == len(LETTERS)
    for pose in poses[1:]:
        assert course.clearance(np.array(pose[:2])) >= FREE_M


def test_boxes_are_framed_and_what_hangs_is_framed_only():
    world = load_world("passage")
    layout = build(world)
    poses = view_poses(Course(layout, 0.154))
    hung = from_above(layout, poses)
    standing = tuple(msgspec.structs.replace(box, bottom_m=0.0) for box in world.box)
    stood = from_above(build(msgspec.structs.replace(world, box=standing)), poses)
    framed = [(np.abs(each.astype(int) - OUTLINE) < 40).all(axis=-1).sum() for each in (hung, stood)]
    assert min(framed) > 100
    dark = [(each == 60).all(axis=-1).sum() for each in (hung, stood)]
    assert dark[1] > dark[0] > 0
