import math
import re
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

import lira.sim_backend
from lira.hal.errors import ConfigError
from lira.sim_backend.catalogue import known_worlds, load_world
from lira.sim_backend.course import Course
from lira.sim_backend.layout import Mark, build, distance_m

OVAL = """
description = "an oval"
[line]
closed = true
pieces = [
  { straight_m = 4.0 }, { radius_m = 2.0, angle_deg = 180 },
  { straight_m = 4.0 }, { radius_m = 2.0, angle_deg = 180 },
]
[limits]
lost_m = 1.0
"""
FIELD = """
description = "a field"
[[box]]
x_m = 3.0
y_m = 0.0
[limits]
lost_m = 5.0
finish_m = 10.0
"""


def write(folder, text):
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("name", known_worlds())
def test_every_world_that_comes_with_the_project_loads_and_builds(name):
    world = load_world(name)
    assert world.name == name
    for seed in range(5):
        layout = build(world, seed)
        assert layout == layout
        assert len(layout.blocks) == len(build(world, seed + 1).blocks)


def test_the_worlds_of_the_thesis_are_there():
    wanted = {"line", "forest", "line-obstacles", "race", "eight", "eight-obstacles"}
    wanted |= {"passage", "passage-train", "corridor", "corridor-train", "garden", "garden-train"}
    assert wanted <= set(known_worlds())


def test_a_users_world_is_loaded_by_its_path(tmp_path):
    world = load_world(write(tmp_path, OVAL))
    assert world.name == "mine"
    assert build(world).curve.length_m == pytest.approx(8.0 + 4.0 * math.pi, abs=1e-3)


def test_the_world_in_the_readme_loads(tmp_path):
    readme = Path(lira.sim_backend.__file__).with_name("README.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"```toml\n(.*?)```", readme, re.DOTALL)
    assert len(build(load_world(write(tmp_path, text))).blocks) == 4


def test_an_unknown_world_names_the_known_ones():
    with pytest.raises(ConfigError, match=r"unknown world 'nosuch'.*eight.*race"):
        load_world("nosuch")


def test_a_missing_file_is_named():
    with pytest.raises(ConfigError, match=r"cannot read nowhere/mine\.toml"):
        load_world("nowhere/mine.toml")


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("lost_m = 1.0", "lost_m = 1.0\nlots_m = 2.0", "unknown key `lots_m`.*limits"),
        ("closed = true", "closed = true\nwidth_m = -0.1", "line.width_m"),
        ("closed = true", "closed = true\ngray = 256", "line.gray"),
        ("angle_deg = 180 },\n]", "angle_deg = 170 },\n]", "ends .* m and 10.0 degrees off"),
        ("{ straight_m = 4.0 }, {", "{ straight_m = 4.0, radius_m = 1.0 }, {", "either straight_m"),
        ("{ straight_m = 4.0 }, {", "{ radius_m = 1.0 }, {", "either straight_m"),
        ("{ straight_m = 4.0 }, {", "{ }, {", "either straight_m"),
        ("lost_m = 1.0", "lost_m = 1.0\nfinish_m = 5.0", "finish_m is for an open line"),
        ("closed = true\n", "", "finish_m is needed"),
        ("[limits]", "[[along]]\ncount = 9\n[limits]", "do not fit on"),
        ("[limits]", "[[along]]\ncount = 2\nbeside_m = [1.0, 0.5]\n[limits]", "nearest, farthest"),
        ("[limits]", "[[box]]\nx_m = 0.3\ny_m = 0.0\n[limits]", "box 1 at .* stands on the start"),
        ("lost_m = 1.0", "lost_m = nan", "lost_m"),
        ("straight_m = 4.0 }, {", "straight_m = inf }, {", "line.pieces"),
        ("straight_m = 4.0 }, {", "straight_m = 4000.0 }, {", "<= 1000"),
        ("[limits]", "[[box]]\nx_m = nan\ny_m = 0.0\n[limits]", "box"),
        ("[limits]", "[[box]]\nx_m = '2'\ny_m = 0.0\n[limits]", "Expected a number.*box"),
        ("[limits]", "[[box]]\nx_m = 2.0\n[limits]", "`y_m` is missing"),
        ("[line]", "[line", "not valid TOML"),
    ],
)
def test_a_mistake_in_a_world_file_is_named(tmp_path, old, new, complaint):
    assert old in OVAL
    with pytest.raises(ConfigError, match=complaint) as caught:
        load_world(write(tmp_path, OVAL.replace(old, new)))
    assert "mine.toml" in caught.value.what or caught.value.remedy


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("[limits]", "[[along]]\ncount = 2\n[limits]", "has no `line`"),
        ("[limits]", "[[area]]\ncount = 2\nx_m = [5.0, 1.0]\ny_m = [0.0, 1.0]\n[limits]", "from < to"),
        ("[limits]", "[[tiles]]\nx_m = [5.0, 1.0]\ny_m = [0.0, 1.0]\n[limits]", "from < to"),
        ("[limits]", "[[tiles]]\nx_m = [0.0, 9.0]\ny_m = [0.0, 1.0]\nsize_m = 0.01\n[limits]", "have 1000 joints"),
        ("[limits]", "[[area]]\ncount = 50\nx_m = [5.0, 6.0]\ny_m = [0.0, 1.0]\n[limits]", "do not fit into the area"),
    ],
)
def test_a_mistake_in_a_world_without_a_line_is_named(tmp_path, old, new, complaint):
    with pytest.raises(ConfigError, match=complaint):
        load_world(write(tmp_path, FIELD.replace(old, new)))


def test_a_layout_comes_back_from_its_seed_and_differs_between_seeds():
    world = load_world("race")
    assert build(world, 3).blocks == build(world, 3).blocks
    assert build(world, 3).blocks != build(world, 4).blocks


def test_a_negative_layout_is_refused():
    with pytest.raises(ConfigError, match="layout -1 is negative"):
        build(load_world("race"), -1)


@pytest.mark.parametrize("seed", range(6))
def test_the_race_has_21_boxes_on_and_beside_its_line(seed):
    blocks = build(load_world("race"), seed).blocks
    assert len(blocks) == 21
    x, y = (np.array([getattr(b, key) for b in blocks]) for key in ("x_m", "y_m"))
    assert (np.diff(np.sort(x)) >= 4.0 - 1e-9).all()
    assert x.min() > 4.0
    assert x.max() < 120.0
    assert (np.abs(y) <= 0.15).sum() == 13
    assert ((np.abs(y) >= 0.5) & (np.abs(y) <= 1.0)).sum() == 8


@pytest.mark.parametrize("name", ["line-obstacles", "eight-obstacles"])
@pytest.mark.parametrize("seed", range(6))
def test_the_obstacles_stand_on_the_line_well_apart(name, seed):
    layout = build(load_world(name), seed)
    xy = np.array([(b.x_m, b.y_m) for b in layout.blocks])
    progress, lateral, _ = layout.curve.project(xy)
    assert {block.gray for block in layout.blocks} == {0}
    assert 40.0 < layout.curve.length_m < 60.0
    assert 6 <= len(xy) <= 10
    assert (np.abs(lateral) <= 0.1 + 1e-3).all()
    gaps = np.diff(np.sort(progress), append=np.sort(progress)[0] + layout.curve.length_m)
    assert (gaps >= 4.0 - 0.05).all()


@pytest.mark.parametrize("seed", range(6))
def test_no_box_of_the_eight_stands_on_both_branches(seed):
    layout = build(load_world("eight-obstacles"), seed)
    crossing = layout.curve.pose(layout.curve.length_m / 2)
    assert crossing[:2] == pytest.approx((0.0, 0.0), abs=0.02)
    xy = np.array([(b.x_m, b.y_m) for b in layout.blocks])
    assert np.hypot(*xy.T).min() > 1.9
    apart = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    assert apart[~np.eye(len(xy), dtype=bool)].min() > 2.0


def test_the_eight_with_obstacles_has_the_line_of_the_eight():
    plain, boxed = (build(load_world(name)).curve.points for name in ("eight", "eight-obstacles"))
    extent = [np.ptp(points, axis=0) for points in (plain, boxed)]
    assert extent[0] == pytest.approx(extent[1], abs=0.05)
    assert len(plain) == len(boxed)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ["passage", "passage-train", "corridor", "garden"])
def test_there_is_a_way_through_near_the_line(name, seed):
    layout = build(load_world(name), seed)
    assert reachable_m(Course(layout, 0.154)) >= layout.world.limits.finish_m


@pytest.mark.parametrize("seed", range(6))
def test_the_corridor_has_five_blocks_and_four_spots_between_its_walls(seed):
    layout = build(load_world("corridor"), seed)
    blocks = [block for block in layout.blocks if block.gray == 250]
    assert (len(blocks), len(layout.marks)) == (5, 4)
    places = sorted((each.x_m, each.y_m) for each in (*blocks, *layout.marks))
    assert np.diff([x for x, _ in places]).min() >= 2.4 - 1e-9
    assert all(abs(y) <= 0.6 for _, y in places)
    training = build(load_world("corridor-train"), seed)
    assert sorted((mark.x_m, mark.y_m) for mark in training.marks) == places


def test_which_of_them_are_fake_changes_with_the_layout():
    real = {tuple(b.x_m > m.x_m for b in layout.blocks for m in layout.marks) for layout in corridors(4)}
    assert len(real) > 1


def corridors(count):
    return [build(load_world("corridor"), seed) for seed in range(count)]


def test_paint_is_where_the_file_says(tmp_path):
    text = FIELD + "[[patch]]\nx_m = 1.0\ny_m = 2.0\nyaw_deg = 90\nlength_m = 0.5\nwidth_m = 0.2\ngray = 9\n"
    layout = build(load_world(write(tmp_path, text)))
    assert layout.marks == (Mark(1.0, 2.0, math.pi / 2, 0.5, 0.2, 9),)
    assert len(layout.blocks) == 1


def test_tiles_have_a_joint_at_each_of_their_edges(tmp_path):
    text = FIELD + "[[tiles]]\nx_m = [-1.0, 1.0]\ny_m = [0.0, 0.5]\nsize_m = 0.5\njoint_m = 0.02\n"
    marks = build(load_world(write(tmp_path, text))).marks
    across = [(mark.x_m, mark.y_m) for mark in marks if mark.length_m == 0.02]
    along = [(mark.x_m, mark.y_m) for mark in marks if mark.width_m == 0.02]
    assert across == [(x, 0.25) for x in (-1.0, -0.5, 0.0, 0.5, 1.0)]
    assert along == [(0.0, 0.0), (0.0, 0.5)]


def test_the_passage_is_the_shortest_way_for_the_lidar_alone():
    world = load_world("passage")
    layout = build(world)
    (lintel,) = (block for block in layout.blocks if block.bottom_m)
    assert lintel.in_the_way
    gap = np.array([lintel.x_m, lintel.y_m])
    course = Course(layout, 0.154)
    assert course.clearance(gap) < 0.0
    lidars = tuple(box for box in world.box if not box.bottom_m)
    assert Course(build(msgspec.structs.replace(world, box=lidars)), 0.154).clearance(gap) > 0.1
    right = min(block.y_m - block.width_m / 2 for block in layout.blocks)
    assert abs(lintel.y_m) < abs(right)


def test_a_long_wall_is_met_however_far_away_its_middle_is():
    obstacles = Course(build(load_world("corridor")), 0.154).obstacles
    beside_the_wall = np.array([0.0, 1.0])
    assert obstacles.near(0.0, 0.0, 4.0).distance(beside_the_wall) == pytest.approx(0.2)
    assert len(obstacles.near(0.0, 0.0, 4.0).x_m) < len(obstacles.x_m)


def reachable_m(course, lateral_m=1.2):
    """How far along the line the robot can come without touching a box or going farther than this from the line."""
    step_m = 0.05
    curve = course.layout.curve
    progress, lateral = np.arange(0.0, curve.length_m, step_m), np.arange(-lateral_m, lateral_m, step_m)
    knots = np.arange(len(curve.points)) * curve.step_m
    x, y, heading = (np.interp(progress, knots, values) for values in (*curve.points.T, curve.headings))
    aside = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    xy = np.stack([x, y], axis=-1)[:, None] + aside[:, None] * lateral[:, None]
    free = course.clearance(xy) > step_m
    _, parts = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)
    start = parts[0, len(lateral) // 2]
    assert start > 0
    return progress[(parts == start).any(axis=1)].max()


def test_the_forest_grows_denser_and_leaves_gaps_and_the_start_free():
    counts = np.zeros(2)
    for seed in range(4):
        blocks = build(load_world("forest"), seed).blocks
        x = np.array([b.x_m for b in blocks[1:]])
        counts += [(x < 23.0).sum(), (x >= 23.0).sum()]
        assert min(distance_m(block, 0.0, 0.0) for block in blocks) > 1.9
        for index, block in enumerate(blocks):
            for other in blocks[:index]:
                assert math.hypot(block.x_m - other.x_m, block.y_m - other.y_m) > 0.45 + 0.7
    assert counts[1] > 2.0 * counts[0]


def test_lines_can_be_followed_at_one_metre_and_one_radian_a_second():
    for name in ("line", "line-obstacles", "eight", "eight-obstacles"):
        curve = build(load_world(name)).curve
        curvature = np.abs(np.diff(curve.headings)) / curve.step_m
        assert curvature.max() < 0.55, name


def test_the_line_bends_both_ways():
    turn = np.diff(build(load_world("line")).curve.headings)
    assert turn.min() < -0.02
    assert turn.max() > 0.02
