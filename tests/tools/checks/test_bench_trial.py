"""Where a trial's time goes: the meter, and that it is put on and taken off."""

import msgspec
import pytest

from lira.fusion.teaching.teacher import ScriptedTeacher
from lira.sim_backend.camera import PinholeCamera
from lira.tools.bench.learning import trial as bench
from lira.tools.experiments.methods import USUAL
from lira.tools.experiments.trial import Trial


@pytest.fixture
def clock(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(bench.time, "process_time", lambda: now[0])
    return now


def test_what_is_called_within_is_not_counted_twice(clock):
    def pass_time(seconds, then=lambda: None):
        clock[0] += seconds
        then()
        clock[0] += seconds

    meter = bench.Meter()
    draw = meter.timed("render", lambda: pass_time(1.0))
    teach = meter.timed("teacher", lambda: pass_time(2.0, draw))
    pass_time(4.0, teach)
    assert meter.stop() == {"rest": 8.0, "teacher": 4.0, "render": 2.0}


def test_an_error_closes_its_share(clock):
    def fail():
        clock[0] += 1.0
        raise OSError

    meter = bench.Meter()
    with pytest.raises(OSError):
        meter.timed("rays", fail)()
    clock[0] += 2.0
    assert meter.stop() == {"rest": 2.0, "rays": 1.0}


def test_a_trial_is_shared_out_and_left_as_it_was():
    before = PinholeCamera.render, ScriptedTeacher.act, ScriptedTeacher._foresee
    learning = msgspec.structs.replace(USUAL[0].learning, labels_per_step=1000)
    method = msgspec.structs.replace(USUAL[0], learning=learning)
    spent = bench.measure(Trial(method, "lane", 0, laps=1, unseen=0))
    assert before == (PinholeCamera.render, ScriptedTeacher.act, ScriptedTeacher._foresee)
    assert set(spent.by_share_s) == set(bench.SHARES)
    assert min(spent.by_share_s.values()) > 0.0
    row = bench.summary(method.name, [spent])
    assert row["method"] == method.name
    assert sum(row[share] for share in bench.SHARES) == pytest.approx(1.0)
    assert row["processor_s"] == pytest.approx(spent.processor_s)


def test_one_long_trial_does_not_make_a_method_slow():
    trials = [bench.Spent(2.0 * seconds, {"rest": seconds}, laps) for seconds, laps in ((4.0, 4), (20.0, 10), (6.0, 6))]
    row = bench.summary("some", trials)
    assert (row["seeds"], row["seconds"], row["processor_s"], row["processor_s_worst"]) == (3, 12.0, 6.0, 20.0)
    assert (row["laps"], row["processor_s_per_lap"], row["rest"]) == (6, 1.0, 1.0)
