"""Three experts where only depth sees the danger: each alone fails, and a novice is taught by all of them."""

import msgspec
import pytest

from lira.fusion.experts.files import experts_of
from lira.fusion.inference.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from lira.fusion.learning.trainer import InlineTrainer
from lira.fusion.methods.presets import METHODS
from lira.hal.profile import load_profile
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.world import Box
from lira.tools.runs.build import build_method
from lira.tools.runs.script import drive
from lira.tools.runs.simulated import simulate

ROBOT = load_profile("thesis-sim-depth")
TABLE_TOPS = load_world("table-top")
NAMES = ("camera", "lidar", "depth")


def with_table_top(aside_m=0.0):
    """The world's line with one table top straight ahead and nothing else."""
    (kind,) = TABLE_TOPS.along
    bottom_m, thickness_m = kind.tops_m
    top = Box(x_m=4.0, y_m=aside_m, bottom_m=bottom_m, height_m=thickness_m, gray=kind.tops_gray)
    return msgspec.structs.replace(TABLE_TOPS, along=(), box=(top,))


def end_of(name, world, steps=60):
    """Where an expert alone comes to in so many steps, or before it hits something."""
    with simulate(world, ROBOT, renderer="sketch") as robot:
        state = None
        for step in drive(robot, f"{name}-expert", steps=steps, experts="table-top"):
            state = step.state
            if state.collided:
                break
    return state


@pytest.mark.parametrize("name", ["camera", "lidar"])
def test_who_sees_no_table_top_drives_into_it(name):
    state = end_of(name, with_table_top())
    assert state.collided
    assert 3.0 < state.x_m < 4.0


@pytest.mark.parametrize("aside_m", [-0.15, 0.0, 0.15])
def test_the_depth_expert_drives_around_a_table_top(aside_m):
    state = end_of("depth", with_table_top(aside_m), steps=30)
    assert not state.collided
    assert state.x_m > 4.5


def test_the_depth_expert_alone_sees_no_line():
    state = end_of("depth", msgspec.structs.replace(TABLE_TOPS, along=()), steps=120)
    assert state.lost


@pytest.mark.parametrize("method", ["hold", "plus"])
def test_a_novice_fuses_all_three_and_its_file_says_so(method, tmp_path):
    assert experts_of(ROBOT) == NAMES
    taught = build_method(METHODS[method], ROBOT, 0, InlineTrainer, "table-top")
    assert tuple(expert.name for expert in taught.experts) == NAMES
    with simulate("table-top", renderer="sketch") as robot:
        steps = list(drive(robot, taught, steps=12))
    step = steps[-1]
    assert tuple(view.name for view in step.proposal.experts) == NAMES
    assert set(step.proposal.features) == {"image", "scan", "depth"}
    network = taught.novice.frozen()
    path = tmp_path / "novice.safetensors"
    save_checkpoint(path, network, Checkpoint.of(network, ROBOT.name, "a test", 0))
    loaded, about = load_checkpoint(path)
    assert about.features == {"image": (32, 32), "scan": (101,), "depth": (32, 32)}
    seen = step.proposal.features
    assert loaded.act(seen) == pytest.approx(network.act(seen), abs=1e-5)
    taught.close()
