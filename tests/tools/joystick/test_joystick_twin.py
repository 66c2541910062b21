"""A person on the twin: with nothing else running, and teaching the learner; and how soon a press takes control."""

import signal
import time
from contextlib import suppress

import pytest
from pad_bed import SONY, Bed, library

from lira.fusion.log.label_log import read_demonstrations
from lira.fusion.log.run_log import ResultRecord, RunRecord, StepRecord, read_run
from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import APPLIED, DECISION, OPERATOR_ANSWER, SIM_STATE
from lira.hal.messages import STOP, Source
from lira.tools.bench import takeover
from lira.tools.launch.processes import ChildProcess, free_port, lira_command
from lira.tools.report import write_report

if library() is None:
    pytest.skip("needs libumockdev (Debian package umockdev)", allow_module_level=True)

PAD = 5
READY_S = 60.0
PRESSES = 5


def newest(reader, condition, timeout_s=30.0):
    deadline_s = time.monotonic() + timeout_s
    while time.monotonic() < deadline_s:
        received = reader.newest()
        if received is not None and condition(received.message):
            return received.message
        time.sleep(0.02)
    raise AssertionError(f"never happened; last: {received}")


def drive_until(bed, reader, condition):
    """Push the stick until it is so; where a busy machine let the robot stop, centre it, as the bridge asks."""
    ends_s = time.monotonic() + READY_S
    while True:
        bed.axis(PAD, "ABS_Y", 0)
        try:
            return newest(reader, condition, 5.0)
        except AssertionError:
            if time.monotonic() > ends_s:
                raise
        bed.axis(PAD, "ABS_Y", 128)
        time.sleep(0.3)


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
    command = lira_command(
        "twin", "--name", address[0], "--listen", address[1], "--world", "line", "--renderer", "sketch"
    )
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
    assert drive_until(bed, state, lambda s: s.progress_m > start_m + 0.3).linear_m_s > 0.3
    bed.key(PAD, "BTN_TL", 0)
    newest(applied, lambda a: a.twist == STOP)
    newest(state, lambda s: abs(s.linear_m_s) < 0.01)


def learner(address, tmp_path, *words):
    where = ["--name", address[0], "--connect", address[1], "--run", str(tmp_path / "run"), "--no-record"]
    return ChildProcess("the learner", lira_command("fusion", *where, *words), tmp_path / "lira.fusion.log")


def test_a_press_takes_control_from_the_learner_which_labels_it(bed, hand, watch, address, tmp_path):
    with learner(address, tmp_path, "--method", "lira", "--idle-frames", "skip") as process:
        decisions, applied = watch.reader(DECISION), watch.reader(APPLIED)
        decision = newest(decisions, lambda d: d.driver == "none", READY_S)
        assert [expert.name for expert in decision.experts] == ["camera", "lidar"]
        assert decision.labels.demonstration == 0
        bed.key(PAD, "BTN_TL", 1)
        hand.wait_ready("you drive", 10.0)
        newest(applied, lambda a: a.source is Source.TELEOP)
        # Before the first training step the human demonstrates.
        decision = drive_until(
            bed, decisions, lambda d: d.labels.demonstration >= 1 and d.human is not None and d.human[0] > 0.1
        )
        assert decision.driver == "human"
        assert decision.human == pytest.approx((0.5, 0.0), abs=0.01)
        assert newest(applied, lambda a: a.source is Source.TELEOP).twist.linear_m_s > 0.0
        # It learns while the hand drives, until it can drive by itself.
        drive_until(bed, decisions, lambda d: d.training_steps >= 1)
        bed.key(PAD, "BTN_TL", 0)
        newest(applied, lambda a: a.source is not Source.TELEOP)
        assert newest(decisions, lambda d: d.driver != "human").training_steps >= 1
        process.signal(signal.SIGINT)
        assert process.wait(30.0) == 0, process.output()
        assert "saved" in process.output()
    demonstrations = list(read_demonstrations(tmp_path / "run" / "labels.lira"))
    by_hand = [d.action for d in demonstrations if d.source == "human"]
    assert by_hand == [pytest.approx((0.5, 0.0), abs=0.02)] * len(by_hand)  # without the frames before the stick moved
    head, *steps, result = read_run(tmp_path / "run" / "run.jsonl")
    assert isinstance(head, RunRecord)
    assert (head.world, head.method, head.idle_frames) == ("line", "lira", "skip")
    assert all(step.state is not None for step in steps)  # a twin tells where the robot was
    assert isinstance(result, ResultRecord)
    # What the hand did beyond the first training step is no demonstration any more.
    given = result.account.given
    assert (result.proof, given["demonstration"] + given.get("human", 0)) == ("none", len(by_hand))
    page = write_report(tmp_path / "run").read_text(encoding="utf-8")
    assert "nothing was proven" in page
    assert "Where it drove" in page
    assert "only a twin knows" not in page
    assert (tmp_path / "run" / "novice.safetensors").is_file()


def press(bed, name, held_s=0.1):
    bed.key(PAD, name, 1)
    time.sleep(held_s)
    bed.key(PAD, name, 0)


def answered(bed, name, answers, condition, held_s=0.1):
    """Press until there is an answer: a bridge that gets no time may see a button only when it is up again."""
    for _ in range(PRESSES):
        press(bed, name, held_s)
        with suppress(AssertionError):
            return newest(answers, condition, 5.0)
    raise AssertionError(f"{name}: no answer")


def test_a_person_pauses_saves_chooses_and_begins_anew_with_the_pad(bed, hand, watch, address, tmp_path):
    labels = tmp_path / "run" / "labels.lira"
    decisions, applied = watch.reader(DECISION), watch.reader(APPLIED, depth=64)
    state, answers = watch.reader(SIM_STATE), watch.reader(OPERATOR_ANSWER)
    with learner(address, tmp_path, "--method", "lira", "--start", "experts") as process:
        newest(state, lambda s: s.progress_m > 1.0, READY_S)

        answer = answered(bed, "BTN_WEST", answers, lambda a: a.paused)
        assert (answer.count, answer.accepted) == (1, True)
        hand.wait_ready("learner: paused: the robot stands", 10.0)
        process.wait_ready("operator: paused: the robot stands", 10.0)
        newest(applied, lambda a: a.source is Source.POLICY and a.twist == STOP)
        newest(state, lambda s: abs(s.linear_m_s) < 0.01)
        # The hand still drives, and is not learned from.
        size = labels.stat().st_size
        bed.key(PAD, "BTN_TL", 1)
        hand.wait_ready("you drive", 10.0)
        drive_until(bed, state, lambda s: s.linear_m_s > 0.3)
        bed.axis(PAD, "ABS_Y", 128)
        bed.key(PAD, "BTN_TL", 0)
        newest(applied, lambda a: a.source is Source.POLICY and a.twist == STOP)
        assert labels.stat().st_size == size
        applied.poll()

        answered(bed, "BTN_WEST", answers, lambda a: a.count == 2 and not a.paused)
        results = [received.message for received in applied.poll()]
        newest(applied, lambda a: a.source is Source.POLICY and a.twist != STOP)
        results += [received.message for received in applied.poll()]
        assert results[0].twist == STOP  # neutral came first
        assert newest(decisions, lambda d: d.driver == "mean").lap == 0

        answer = answered(bed, "BTN_DPAD_RIGHT", answers, lambda a: a.count == 3)
        assert (answer.accepted, answer.words) == (False, "this method gives no expert control")

        assert answered(bed, "BTN_NORTH", answers, lambda a: a.count == 4).words.startswith("saved ")
        process.wait_ready("operator: saved", 10.0)
        assert labels.stat().st_size > size

        answer = answered(bed, "BTN_EAST", answers, lambda a: a.count == 5, held_s=1.3)
        assert answer.words == "episode 1 begins, back at the start"
        assert newest(state, lambda s: s.progress_m < 0.5).progress_m >= 0.0
        newest(applied, lambda a: a.source is Source.POLICY and a.twist != STOP)
        newest(decisions, lambda d: d.lap == 1)
    steps = [record for record in read_run(tmp_path / "run" / "run.jsonl") if isinstance(record, StepRecord)]
    assert [step.decision.lap for step in steps] == sorted(step.decision.lap for step in steps)
    assert {d.lap for d in read_demonstrations(labels)} == {0, 1}


@pytest.mark.alone
def test_takeover_is_measured(monkeypatch):
    monkeypatch.setattr(takeover, "SAMPLES", 10)
    monkeypatch.setattr(takeover, "WARM_UP", 1)
    rows = takeover.run()
    assert [row["by"] for row in rows] == ["pad", "web"]
    for row in rows:
        assert row["samples"] == 10
        assert 0.0 < row["p50_ms"] <= row["p99_ms"] <= row["max_ms"]
        assert row["p50_ms"] < 50.0
