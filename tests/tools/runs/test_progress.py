import io

import msgspec
import pytest
from synthetic_run import write_run

from lira.fusion.log.run_log import LapRecord, StepRecord, read_run
from lira.hal.errors import StorageError
from lira.hal.messages import Phase
from lira.tools.report.digest import digest
from lira.tools.runs import progress
from lira.tools.runs.progress import Display, Progress, Tail


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture(scope="module")
def run_file(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("run"))


def test_tail_loses_nothing_and_never_gives_half_a_record(run_file, tmp_path):
    data = run_file.read_bytes()[:20_000]
    path = tmp_path / "growing.jsonl"
    tail = Tail(path)
    assert tail.read() == []
    records = []
    for start in range(0, len(data), 777):
        with path.open("ab") as file:
            file.write(data[start : start + 777])
        records += tail.read()
    assert records == list(read_run(path))
    assert len(records) > 10


def test_tail_says_so_when_the_file_is_something_else(tmp_path):
    (tmp_path / "x").write_text("hello\n")
    with pytest.raises(StorageError, match="not a run record"):
        Tail(tmp_path / "x").read()


def test_every_lap_and_the_end_leave_a_line(run_file):
    watch = Progress()
    lines = [line for record in read_run(run_file) if (line := watch.note(record))]
    assert len(lines) == 1 + 7 + 1
    assert lines[0] == "lira (hold) on line-obstacles, layout 0, seed 1"
    assert lines[1].startswith("training lap 1   passed")
    assert lines[2].startswith("proving run 1.1  failed")
    assert "collisions 1, lost 0" in lines[2]
    assert lines[-1].startswith("proven after 2 training laps: the novice alone passed the layout it was taught on; ")
    assert watch.result is not None
    assert watch.result.converged


def test_proving_runs_after_one_lap_are_told_apart_and_named_as_in_the_report():
    lap = LapRecord(Phase.PROVE, 1, 0, True, True, 57.0, 0, 0, None, 0, 0, 0, 0, 0, 0.0)
    laps = [lap, lap, msgspec.structs.replace(lap, lap=2), lap]
    watch = Progress()
    names = [line.split("  ")[0] for record in laps if (line := watch.note(record))]
    assert names == ["proving run 1.1", "proving run 1.2", "proving run 2.1", "proving run 1.3"]
    assert [each.title.lower() for each in digest(laps).laps] == names


def test_the_status_tells_who_drives_and_how_fast(run_file):
    watch = Progress()
    assert watch.status() == ""
    for record in read_run(run_file):
        if isinstance(record, LapRecord):
            break
        watch.note(record)
        if isinstance(record, StepRecord) and record.decision.call == "feedback":
            assert "human drives | feedback call" in watch.status()
    assert watch.status().startswith("training lap 1 | ")
    assert watch.status().endswith("| 20x real time")


def test_on_a_terminal_the_status_is_rewritten_in_place(monkeypatch):
    monkeypatch.setattr(progress, "TTY_PERIOD_S", 0.0)
    terminal = Terminal()
    display = Display(terminal)
    display.status("one")
    display.status("two")
    display.keep("done")
    display.close()
    assert terminal.getvalue() == "one\r\x1b[Ktwo\r\x1b[Kdone\n"


def test_a_long_status_stays_on_one_line(monkeypatch):
    monkeypatch.setattr(progress, "TTY_PERIOD_S", 0.0)
    monkeypatch.setenv("COLUMNS", "40")
    terminal = Terminal()
    Display(terminal).status("x" * 200)
    assert len(terminal.getvalue()) == 39


def test_without_a_terminal_there_are_no_control_characters_and_few_lines(monkeypatch):
    out = io.StringIO()
    display = Display(out)
    for number in range(100):
        display.status(f"step {number}")
    display.keep("lap")
    display.close()
    assert out.getvalue() == "lap\n"
    monkeypatch.setattr(progress, "PLAIN_PERIOD_S", 0.0)
    display = Display(out)
    display.status("step")
    assert out.getvalue() == "lap\nstep\n"
