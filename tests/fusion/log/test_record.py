import math

import pytest

from lira.fusion.log.run_log import (
    ContradictionRecord,
    LapRecord,
    Pose,
    ResultRecord,
    RunRecord,
    RunWriter,
    StepRecord,
    read_run,
)
from lira.hal.errors import StorageError
from lira.hal.messages import CourseState, Decision, ExpertView, LabelCounts

DECISION = Decision(
    0.4, 2, "human", "feedback", (0.5, -1.0), (0.4, 0.0), (0.5, -1.0), (ExpertView("camera", (1.0, 0.0), 0.1, True),),
    0.06, LabelCounts(given_human=3), 1, 2, 3, "train", 1,
)  # fmt: skip
STATE = CourseState(0.4, 1.0, 2.0, 0.1, 0.5, 0.0, math.nan, math.nan, math.inf, collided=True)
RECORDS = [
    RunRecord("line", "thesis-sim", "lira", "hold", 0, 7, "lira demo --note 'ü'", "0.1.0"),
    StepRecord(DECISION, Pose.of(STATE), 3, "human", bytes(range(256)) * 4, 0.25),
    StepRecord(DECISION),
    LapRecord("train", 1, 3, False, False, 12.0, 1, 0, None, 9, 2, 3, 40, 1, 3.5),
    ResultRecord(False, 12, 9, 30, 2, 3, 40, 1, 144.0, 9.0),
]


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "a folder" / "run.jsonl"
    with RunWriter(path) as writer:
        for record in RECORDS:
            writer.write(record)
    return path


def test_what_is_written_is_read_back(path):
    assert list(read_run(path)) == RECORDS
    assert Pose.of(STATE).progress_m is None
    assert Pose.of(STATE).clearance_m is None


def test_a_contradiction_of_before_whose_time_was_into_its_lap_is_read_without_a_time(path):
    aside = (
        b'{"number":6,"source":"human","lap":1,"stamp_s":5.4,"action":[1.0,0.5],"others":[0.9,-0.7],"mirrored":true}'
    )
    lines = path.read_bytes().replace(b'"contradictions":[]', b'"contradictions":[' + aside + b"]")
    path.write_bytes(lines)
    *_, result = read_run(path)
    assert result.contradictions == (ContradictionRecord(6, "human", 1, (1.0, 0.5), (0.9, -0.7), mirrored=True),)


def test_a_second_writer_goes_on_behind_the_first(path):
    with RunWriter(path) as writer:
        writer.write(RECORDS[0])
    assert list(read_run(path)) == [*RECORDS, RECORDS[0]]


def test_the_torn_last_line_of_a_killed_run_is_left_out(path):
    whole = path.read_bytes()
    for cut in (1, 5, 60):
        path.write_bytes(whole[:-cut])
        assert list(read_run(path)) == RECORDS[:-1]


def test_a_run_that_goes_on_after_a_kill_goes_on_behind_the_last_whole_line(path):
    whole = path.read_bytes()
    for cut in (1, 60):
        path.write_bytes(whole[:-cut])
        with RunWriter(path) as writer:
            writer.write(RECORDS[0])
        assert list(read_run(path)) == [*RECORDS[:-1], RECORDS[0]]


@pytest.mark.parametrize("content", [b"x" * 3_000_000, b"[" * 900_000 + b"\n"])
def test_an_endless_line_and_one_nested_without_end_are_named(path, content):
    path.write_bytes(content)
    with pytest.raises(StorageError, match=r"line 1, is not a run record"):
        list(read_run(path))
    path.unlink()
    path.symlink_to("/dev/zero")
    with pytest.raises(StorageError, match="cannot read"):
        list(read_run(path))


@pytest.mark.parametrize("line", [b"not json\n", b'{"type":"nosuch"}\n', b'{"type":"lap"}\n', b"\xff\xfe\n"])
def test_a_damaged_line_is_named(path, line):
    path.write_bytes(path.read_bytes() + line + b"{}\n")
    with pytest.raises(StorageError, match=r"run\.jsonl, line 6, is not a run record"):
        list(read_run(path))


def test_a_missing_record_is_one_clear_error(tmp_path):
    with pytest.raises(StorageError, match="cannot read"):
        list(read_run(tmp_path / "none.jsonl"))


def test_a_folder_that_cannot_be_made_and_a_full_disk_say_what_to_do(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match=r"cannot write the run record.*another folder"):
        RunWriter(tmp_path / "file" / "run.jsonl")
    full = tmp_path / "full"
    full.symlink_to("/dev/full")
    with RunWriter(full) as writer, pytest.raises(StorageError, match=r"No space left.*Free some space"):
        writer.write(RECORDS[0])
