import sys

import pytest

from lira.hal.profile import load_profile
from lira.sim_backend.twin import Twin
from lira.tools.bench import twin as bench


@pytest.mark.parametrize("renderer", ["sketch", "tiny"])
def test_a_row_has_what_the_table_needs(monkeypatch, renderer):
    monkeypatch.setattr(bench, "RUNS", 2)
    row = bench.measure(bench.Load("thesis-sim", 0.2, 2.0), renderer)
    assert row["profile"] == "thesis-sim"
    assert row["renderer"] == renderer
    assert row["real_time_factor"] > 1.0
    assert len(row["runs"]) == 2
    assert row["ratio_to_bare"] is None if renderer == "sketch" else row["ratio_to_bare"] > 0.5


def test_there_is_a_row_for_each_scene_that_the_machine_has(monkeypatch):
    monkeypatch.setattr(bench, "measure", lambda load, renderer: {"profile": load.profile, "renderer": renderer})
    asked = [(row["profile"], row["renderer"]) for row in bench.run()]
    assert asked == [(name, each) for name in ("thesis-sim", "rosbot2") for each in ("sketch", "auto")]
    monkeypatch.setitem(sys.modules, "pybullet", None)
    assert [row["renderer"] for row in bench.run()] == ["sketch", "sketch"]


@pytest.mark.parametrize(("load", "calls"), [(bench.LOADS[0], 2 * 200), (bench.LOADS[1], 60 + 40)])
def test_the_bare_calls_are_as_many_as_the_sensors_periods(load, calls):
    robot = Twin(load_profile(load.profile), bench.WORLD, renderer="tiny")
    robot.open()
    with bench.bare_calls(robot.profile, robot, load) as bare:
        assert len(bare) == calls
    state = robot.state()
    assert state.x_m > 0.5 * load.run_s * robot.profile.base.max_linear_m_s
    assert not state.collided
    robot.close()
