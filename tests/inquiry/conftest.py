"""A short lap that was taught on a twin in this process, and all that was told of it."""

from functools import partial

import pytest
from short_worlds import FEW_METRES

from lira.fusion.inference.threads import one_thread
from lira.fusion.learning.trainer import InlineTrainer
from lira.fusion.methods.presets import method_named
from lira.tools.runs.plan import Plan
from lira.tools.runs.simulated import simulate
from lira.tools.runs.teach import teach_on


def taught(method, tmp_path):
    """Teach for one lap; return the profile and all that was told on the bus."""
    one_thread()  # as whoever teaches does: sums depend on it
    path = tmp_path / "few.toml"
    path.write_text(FEW_METRES)
    reports = []
    with simulate(str(path), "thesis-sim", renderer="sketch") as robot:
        trainer = partial(InlineTrainer, adopt_after_s=robot.profile.period_s)
        plan = Plan(method_named(method), laps=1, unseen=1, pair="line")
        teach_on(robot, robot.arena, robot.arena.world, plan, trainer, publish=reports.append)
        return robot.profile, reports


@pytest.fixture(scope="session", params=["plus", "hold"])
def run(request, tmp_path_factory):
    return taught(request.param, tmp_path_factory.mktemp("world"))


@pytest.fixture(scope="session")
def plus(tmp_path_factory):
    return taught("plus", tmp_path_factory.mktemp("world"))
