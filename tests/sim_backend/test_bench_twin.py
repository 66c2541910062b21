import pytest

from lira.hal.profile import load_profile
from lira.sim_backend.twin import Twin
from lira.tools.bench import twin as bench


def test_a_row_has_what_the_table_needs(monkeypatch):
    monkeypatch.setattr(bench, "RUNS", 2)
    row = bench.measure(bench.Load("thesis-sim", 0.2, 2.0))
    assert row["profile"] == "thesis-sim"
    assert row["renderer"] == "tiny"
    assert row["real_time_factor"] > 1.0
    assert row["ratio_to_bare"] > 0.5
    assert len(row["runs"]) == 2


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
