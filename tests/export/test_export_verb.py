"""`lira export` of a recording on disk, with and without the log of labels beside it."""

import csv

import h5py
import msgspec
import pyarrow.parquet as pq
import pytest
from fresh import python
from heard import LENGTHS, PROFILE, label, recording

from lira.fusion.log.label_log import DemonstrationLog
from lira.hal.bus.reader import RawSample
from lira.hal.bus.services import Info
from lira.hal.bus.topics import TOPICS
from lira.hal.messages.ros.codec import encode
from lira.tools.cli import main
from lira.tools.export.run import labels_beside, load_run
from lira.tools.recording.layout import FOLDER, Head
from lira.tools.recording.writer import RecordingWriter

TYPES = {topic.key: topic.ros_type for topic in TOPICS}
BEGAN_NS = 1_700_000_000_000_000_000


def record(folder, messages):
    arena = msgspec.Raw(b'{"name": "line"}')
    head = Head("rosbot", "0", BEGAN_NS, BEGAN_NS, Info(PROFILE, "realtime", 1, arena), "test")
    writer = RecordingWriter(folder, head, split_bytes=2**30)
    for number, (key, payload) in enumerate(messages):
        now_ns = BEGAN_NS + number * 1_000_000
        writer.add(RawSample(key, TYPES[key], payload, None, 0.0), now_ns, now_ns)
    writer.close()


@pytest.fixture
def run(tmp_path):
    """Folder of a run with a recording, and no labels."""
    record(tmp_path / "run" / FOLDER, ((each.key, encode(each.message)) for each in recording()))
    return tmp_path / "run"


def rows_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_run_becomes_a_lerobot_data_set(run, tmp_path, capsys):
    assert main(["export", "lerobot", str(run), str(tmp_path / "set")]) == 0
    assert "2 episodes, 9 steps; labels learned: 1, by the recording's counts" in capsys.readouterr().out
    rows = pq.read_table(tmp_path / "set/data/chunk-000/file-000.parquet")
    assert len(rows) == sum(LENGTHS)
    assert pq.read_table(tmp_path / "set/meta/tasks.parquet")["task"].to_pylist() == ["drive in line"]


def test_the_labels_beside_it_say_what_was_learned(run, tmp_path, capsys):
    with DemonstrationLog(run / "labels.lira", PROFILE) as log:
        for number, driver in enumerate(("human", "human", "camera")):
            log.append(label(number, driver, stored=True))
    assert main(["export", "csv", str(run), str(tmp_path / "run.csv")]) == 0
    assert "labels learned: 3, by " in capsys.readouterr().out
    assert [row["in_buffer"] for row in rows_of(tmp_path / "run.csv")][:4] == ["1", "1", "1", "0"]


@pytest.mark.parametrize("inside", ["", FOLDER, f"{FOLDER}/{FOLDER}_0.mcap"])
def test_the_labels_are_found_from_any_part_of_a_run(run, inside):
    assert labels_beside(run / inside) is None
    (run / "labels.lira").touch()
    assert labels_beside(run / inside) == run / "labels.lira"


def test_robomimic_gets_its_file(run, tmp_path):
    assert main(["export", "robomimic", str(run), str(tmp_path / "run.hdf5")]) == 0
    with h5py.File(tmp_path / "run.hdf5") as file:
        assert file["data"].attrs["total"] == sum(LENGTHS)


def test_nothing_is_written_over(run, tmp_path, capsys):
    (tmp_path / "run.csv").write_text("mine")
    assert main(["export", "csv", str(run), str(tmp_path / "run.csv")]) == 2
    assert "nothing is written over" in capsys.readouterr().err
    assert main(["export", "csv", str(run), str(tmp_path / "gone" / "run.csv")]) == 2
    assert f"there is no folder {tmp_path / 'gone'}" in capsys.readouterr().err


def test_a_message_that_cannot_be_read_is_left_out(tmp_path):
    whole = [(each.key, encode(each.message)) for each in recording()]
    record(tmp_path / "run", [whole[0], (whole[1][0], b"\0\1\0\0 nothing"), *whole[1:]])
    assert [len(table) for table in load_run(tmp_path / "run").tables] == list(LENGTHS)


def test_a_recording_in_which_nobody_decides_is_told(tmp_path, capsys):
    record(tmp_path / "run", [])
    assert main(["export", "csv", str(tmp_path / "run"), str(tmp_path / "run.csv")]) == 2
    assert "nobody decided anything" in capsys.readouterr().err


def test_nobody_needs_pytorch_for_it(run, tmp_path):
    """Who exports a run on a laptop without the learner has neither it nor what comes with it."""
    words = ["export", "lerobot", str(run), str(tmp_path / "set")]
    taken = ["import", str(tmp_path / "set"), "--run", str(tmp_path / "warm")]
    absent = f"import sys; sys.modules.update(dict.fromkeys({['torch', 'safetensors', 'pybullet']}))"
    code = f"{absent}; from lira.tools.cli import main; sys.exit(main({words}) or main({taken}))"
    done = python(code)
    assert done.returncode == 0, done.stderr
