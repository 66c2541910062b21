"""LIRA-SPF with three experts, one of them a Python function, from the twin to the report and the console."""

from dataclasses import replace
from itertools import pairwise

import pytest

from lira.fusion.learning.trainer import InlineTrainer
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import RunRecord, RunWriter, read_run
from lira.fusion.methods.presets import METHODS
from lira.hal.profile import load_profile
from lira.tools.console import draw
from lira.tools.console.canvas import Canvas
from lira.tools.console.sample import sample_view
from lira.tools.report import write_report
from lira.tools.report.digest import load_run
from lira.tools.runs.build import build_method
from lira.tools.runs.script import drive
from lira.tools.runs.simulated import simulate

PROFILE = load_profile("thesis-sim")
STEPS = 60


def wall(seen):
    """Turn left where something is near on the right."""
    return 1.0, 0.8 if seen.scan[:50].min() < 0.4 else 0.0


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    path = tmp_path_factory.mktemp("three") / "run.jsonl"
    method = build_method(METHODS["hold-scratch"], PROFILE, 0, InlineTrainer, more=[wall])
    method.novice.training_steps = 1  # as if it had been taught: before that a human is asked to drive
    with simulate("line-obstacles", renderer="tiny") as robot, RunWriter(path) as writer:
        writer.write(RunRecord("line-obstacles", PROFILE.name, "lira", "hold", 0, 0, "lira", "0"))
        journal = Journal(write=writer.write)
        for step in drive(robot, method, steps=STEPS):
            journal.note(step, phase="train", lap=1, layout=0, training_steps=1)
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
    monkeypatch.setattr(Canvas, "write", lambda _, words, at, *_rest, **_more: written.setdefault(words, at))
    box = pygame.Rect(0, 0, 720, 330)
    decision = list(read_run(record))[-1].decision
    draw.draw_actions(Canvas(pygame.Surface(box.size)), box, replace(sample_view(), decision=decision))
    names = ["camera", "lidar", "wall", "novice", "drives"]
    rows = [written[name][1] for name in names]
    assert all(below - above >= 30 for above, below in pairwise(rows))  # none on another
    assert rows[-1] < box.bottom - 22
