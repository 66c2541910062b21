"""A person on the twin: with nothing else running, and teaching the learner; and how soon a press takes the wheel."""

import time

import pytest
from pad_bed import SONY, Bed, library

from hal.bus import Bus
from hal.messages import STOP, Source
from hal.topics import APPLIED, DECISION, SIM_STATE
from tools.bench import takeover
from tools.processes import ChildProcess, free_port, lira_command

if library() is None:
    pytest.skip("needs libumockdev (Debian package umockdev)", allow_module_level=True)

PAD = 5
READY_S = 60.0


def newest(reader, condition, timeout_s=30.0):
    deadline_s = time.monotonic() + timeout_s
    while time.monotonic() < deadline_s:
        received = reader.newest()
        if received is not None and condition(received.message):
            return received.message
        time.sleep(0.02)
    raise AssertionError(f"never happened; last: {received}")


@pytest.fixture
def address():
    port = free_port()
    return f"hand_{port}", f"127.0.0.1:{port}"


@pytest.fixture
def bed(tmp_path):
    bed = Bed(tmp_path)
    bed.plug(4, f"{SONY} Motion Sensors", motion=True)
    bed.plug(PAD)
    yield bed
    bed.close()


@pytest.fixture
def twin(address, tmp_path):
    command = lira_command("twin", "--name", address[0], "--listen", address[1], "--world", "line")
    with ChildProcess("the twin", command, tmp_path / "twin.log") as process:
        process.wait_ready("serves world", READY_S)
        yield process


@pytest.fixture
def watch(address, twin):
    bus = Bus(address[0], connect=address[1], watch=True)
    yield bus
    bus.close()


@pytest.fixture
def hand(address, twin, bed, tmp_path):
    command = lira_command("joystick", "--name", address[0], "--connect", address[1])
    with ChildProcess("the bridge", [*bed.environment, *command], tmp_path / "bridge.log") as process:
        process.wait_ready("ready: hold the dead-man", READY_S)
        yield process
    assert "Traceback" not in process.output()


def test_twin_and_joystick_drive_with_nothing_else_running(bed, hand, watch):
    state, applied = watch.reader(SIM_STATE), watch.reader(APPLIED)
    start_m = newest(state, lambda s: s.progress_m >= 0.0).progress_m
    bed.key(PAD, "BTN_TL", 1)
    hand.wait_ready("you drive", 10.0)
    newest(applied, lambda a: a.source is Source.TELEOP)
    bed.axis(PAD, "ABS_Y", 0)
    assert newest(state, lambda s: s.progress_m > start_m + 0.3).linear_m_s > 0.3
    bed.key(PAD, "BTN_TL", 0)
    newest(applied, lambda a: a.twist == STOP)
    newest(state, lambda s: abs(s.linear_m_s) < 0.01)


def test_a_press_takes_the_wheel_from_the_learner_which_labels_it(bed, hand, watch, address, tmp_path):
    words = ("--method", "lira", "--run", str(tmp_path / "run"))
    command = lira_command("fusion", "--name", address[0], "--connect", address[1], *words)
    with ChildProcess("the learner", command, tmp_path / "fusion.log"):
        decisions, applied = watch.reader(DECISION), watch.reader(APPLIED)
        assert newest(decisions, lambda d: d.experts, READY_S).labels.demonstration == 0
        bed.key(PAD, "BTN_TL", 1)
        hand.wait_ready("you drive", 10.0)
        newest(applied, lambda a: a.source is Source.TELEOP)
        bed.axis(PAD, "ABS_Y", 0)
        # Before the first training step the human demonstrates, from the press on: at first with the stick centred.
        decision = newest(decisions, lambda d: d.labels.demonstration >= 1 and d.human is not None and d.human[0] > 0.1)
        assert decision.driver == "human"
        assert decision.human == pytest.approx((0.5, 0.0), abs=0.01)
        assert newest(applied, lambda a: a.source is Source.TELEOP).twist.linear_m_s > 0.0
        bed.key(PAD, "BTN_TL", 0)
        newest(applied, lambda a: a.source is not Source.TELEOP)


def test_takeover_is_measured(monkeypatch):
    monkeypatch.setattr(takeover, "SAMPLES", 10)
    monkeypatch.setattr(takeover, "WARM_UP", 1)
    (row,) = takeover.run()
    assert row["samples"] == 10
    assert 0.0 < row["p50_ms"] <= row["p99_ms"] <= row["max_ms"]
    assert row["p50_ms"] < 50.0
