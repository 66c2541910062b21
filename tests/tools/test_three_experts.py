"""LIRA-SPF with three experts, one of them a Python function, from the twin to the report and the console."""

from dataclasses import replace
from itertools import pairwise

import pytest

from lira.fusion.control import ControlLoop
from lira.fusion.experts.load import load_expert
from lira.fusion.learning.learner import Learner
from lira.fusion.learning.novice import LearningSettings, NetworkNovice
from lira.fusion.learning.trainer import InlineTrainer
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import RunRecord, RunWriter, read_run
from lira.fusion.methods.base import Expert
from lira.fusion.methods.lira import PRESETS, LiraSpf
from lira.fusion.policies.networks import FusionNet
from lira.hal.profile import load_profile
from lira.hal.safety.governed import GovernedRobot
from lira.sim_backend.twin import Twin
from lira.tools.console import draw
from lira.tools.console.sample import sample_view
from lira.tools.report import write_report
from lira.tools.report.digest import load_run

PROFILE = load_profile("thesis-sim")
STEPS = 60


def wall(seen):
    """Turn left where something is near on the right."""
    return 1.0, 0.8 if seen.scan[:50].min() < 0.4 else 0.0


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    path = tmp_path_factory.mktemp("three") / "run.jsonl"
    experts = [load_expert("camera-expert", PROFILE), load_expert("lidar-expert", PROFILE), Expert("wall", wall)]
    network = FusionNet(PROFILE.features.bins, PROFILE.features.filters)
    novice = NetworkNovice(network, InlineTrainer(Learner(network, seed=0, frozen_trunks=False)), LearningSettings())
    novice.training_steps = 1
    method = LiraSpf(experts, novice, PRESETS["hold"], PROFILE.period_s)
    twin = Twin(PROFILE, "line-obstacles", renderer="tiny")
    robot = GovernedRobot(twin)
    robot.open()
    try:
        with RunWriter(path) as writer:
            writer.write(RunRecord("line-obstacles", PROFILE.name, "lira", "hold", 0, 0, "lira", "0"))
            journal, loop = Journal(write=writer.write), ControlLoop(robot, truth=twin.state)
            loop.arm()
            for _ in range(STEPS):
                step = loop.step(method)
                journal.note(step, phase="train", lap=1, layout=0, training_steps=1)
    finally:
        robot.close()
    return path


def test_all_three_are_asked_at_every_step_and_named_in_the_record(record):
    steps = list(read_run(record))[1:]
    assert len(steps) == STEPS
    for step in steps:
        assert [view.name for view in step.decision.experts] == ["camera", "lidar", "wall"]
    assert any(step.decision.experts[2].active for step in steps)


def test_the_report_names_all_who_drove(record):
    drove = {step.decision.driver for step in list(read_run(record))[1:]}
    assert "wall" in drove
    page = write_report(record.parent).read_text()
    for name in drove - {"novice", "mean"}:
        assert f"{name} expert" in page
    assert load_run(record).experts == ("camera", "lidar", "wall")


def test_the_console_draws_a_row_for_each(record, monkeypatch):
    pygame = pytest.importorskip("pygame")
    pygame.init()
    written = {}
    monkeypatch.setattr(draw, "write", lambda _, words, at, *_rest, **_more: written.setdefault(words, at))
    box = pygame.Rect(0, 0, 720, 330)
    decision = list(read_run(record))[-1].decision
    draw.draw_actions(pygame.Surface(box.size), box, replace(sample_view(), decision=decision))
    names = ["camera", "lidar", "wall", "novice", "drives"]
    rows = [written[name][1] for name in names]
    assert all(below - above >= 30 for above, below in pairwise(rows))  # none on another
    assert rows[-1] < box.bottom - 22
