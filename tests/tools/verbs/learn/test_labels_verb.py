import json

import numpy as np
import pytest

from lira.fusion.log.label_log import Demonstration, DemonstrationLog, read_demonstrations
from lira.fusion.preprocess import Features
from lira.hal.profile import load_profile
from lira.tools.cli import main

SIM = load_profile("thesis-sim")


def label(k: int) -> Demonstration:
    rng = np.random.default_rng(k)
    seen = Features(scan=rng.random(101, np.float32), image=rng.random((32, 32), np.float32))
    return Demonstration(0.2 * k, k, 0, "human", (0.5, 0.1), (0.0, 0.0), True, seen)


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "labels.lira"
    with DemonstrationLog(path, SIM) as opened:
        begin = path.stat().st_size
        for k in range(100):
            opened.append(label(k))
    return path, begin, (path.stat().st_size - begin) // 100


def test_a_whole_log(log, capsys):
    path, _, _ = log
    assert main(["labels", "check", str(path)]) == 0
    assert capsys.readouterr().out == f"{path}: 100 labels given, of 'thesis-sim' in 1 run\n  nothing is damaged\n"


def test_a_byte_taken_out_of_the_third_of_100_costs_one_label(log, capsys):
    path, begin, size = log
    data, at = path.read_bytes(), begin + 2 * size + size // 2
    broken = data[:at] + data[at + 1 :]
    path.write_bytes(broken)
    assert main(["labels", "check", str(path), "--json", "-"]) == 1
    said = json.loads(capsys.readouterr().out)
    assert said["labels"] == 99
    assert said["damages"] == [{"at_byte": begin + 2 * size, "bytes": size - 1}]
    assert path.read_bytes() == broken
    assert main(["labels", "check", str(path)]) == 1
    assert "99 labels" in capsys.readouterr().out
    assert main(["labels", "check", str(path), "--repair"]) == 0
    assert "kept as" in capsys.readouterr().out
    assert [each.observation for each in read_demonstrations(path)] == [0, 1, *range(3, 100)]
    assert path.with_name("labels.lira.damaged").read_bytes() == broken
    assert main(["labels", "check", str(path)]) == 0


def test_what_is_no_log_is_an_error(tmp_path, capsys):
    path = tmp_path / "notes.txt"
    path.write_text("hello")
    for words in ([str(path)], [str(path), "--repair"], [str(tmp_path / "none")], [str(tmp_path)]):
        assert main(["labels", "check", *words]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 2
    assert path.read_text() == "hello"
