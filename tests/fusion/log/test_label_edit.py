"""Labels are taken back, learned again and merged, and none is lost by it."""

import os

import numpy as np
import pytest

from lira.fusion.log.label_edit import correct, last_intervention, merge
from lira.fusion.log.label_log import (
    Demonstration,
    DemonstrationLog,
    check_log,
    read_demonstrations,
    read_records,
    repair_log,
)
from lira.fusion.preprocess import Features
from lira.hal.errors import ConfigError, StorageError
from lira.hal.profile import load_profile

SIM, REAL = load_profile("thesis-sim"), load_profile("rosbot2")


def label(k, source="human", *, lap=1, stored=True, profile=SIM):
    rng = np.random.default_rng(k)
    seen = Features(scan=rng.random(profile.features.bins, np.float32), image=rng.random((32, 32), np.float32))
    return Demonstration(0.2 * k, k, lap, source, (1.0, 0.01 * (k % 90)), (0.0, 0.0), stored, seen)


def written(path, *labels, profile=SIM):
    with DemonstrationLog(path, profile) as log:
        for each in labels:
            log.append(each)
    return path


def stored(path):
    return [each.stored for each in read_demonstrations(path)]


@pytest.fixture
def log(tmp_path):
    return written(tmp_path / "labels.lira", *map(label, range(6)))


def test_what_is_taken_back_stays_and_can_be_learned_again(log):
    before = log.read_bytes()
    assert [each.observation for each in correct(log, [4, 2], stored=False)] == [2, 4]
    assert log.read_bytes().startswith(before)
    assert stored(log) == [True, True, False, True, False, True]
    assert [each.undone for each in read_demonstrations(log)] == [False, False, True, False, True, False]
    assert [each.observation for each in correct(log, [2], stored=True)] == [2]
    assert stored(log) == [True, True, True, True, False, True]
    correct(log, [2], stored=False)
    assert stored(log) == [True, True, False, True, False, True]
    assert check_log(log).count == 6


def test_what_is_so_already_is_not_written(log):
    correct(log, [3], stored=False)
    size = log.stat().st_size
    assert correct(log, [3], stored=False) == []
    assert correct(log, [1], stored=True) == []
    assert log.stat().st_size == size


def test_what_was_redundant_is_not_learned_by_taking_it_back_and_again(tmp_path):
    path = written(tmp_path / "log", label(0, stored=False))
    assert correct(path, [0], stored=False) == []
    assert correct(path, [0], stored=True) == []
    assert stored(path) == [False]


@pytest.mark.parametrize("number", [-1, 6])
def test_a_number_that_no_label_has_changes_nothing(log, number):
    before = log.read_bytes()
    with pytest.raises(ConfigError, match="has no label"):
        correct(log, [0, number], stored=False)
    assert log.read_bytes() == before


def test_a_log_in_use_is_left_alone(log):
    with DemonstrationLog(log, SIM), pytest.raises(StorageError, match="in use"):
        correct(log, [0], stored=False)
    assert all(stored(log))


def test_a_damaged_log_is_mended_first_and_its_corrections_stay(log):
    correct(log, [1], stored=False)
    data = bytearray(log.read_bytes())
    data[-5] ^= 0xFF  # in the correction itself
    log.write_bytes(data)
    with pytest.raises(StorageError, match=r"is damaged.*lira labels check"):
        correct(log, [2], stored=False)
    repair_log(log)
    correct(log, [1, 2], stored=False)
    assert stored(log) == [True, False, False, True, True, True]


def test_a_label_that_is_damaged_comes_back_from_its_correction(log):
    size = (log.stat().st_size - correct_at(log)) // 6
    correct(log, [1], stored=False)
    data = bytearray(log.read_bytes())
    data[correct_at(log) + size + 100] ^= 0xFF
    log.write_bytes(data)
    repair_log(log)
    found = {each.observation: each for each in read_demonstrations(log)}
    assert sorted(found) == [0, 1, 2, 3, 4, 5]
    assert (found[1].stored, found[1].correction) == (False, False)
    correct(log, [list(found).index(1)], stored=True)
    assert all(stored(log))


def correct_at(log):
    """Where the records begin."""
    return check_log(log).begin


def test_who_opens_the_log_goes_on_behind_the_corrections(log):
    correct(log, [5], stored=False)
    with DemonstrationLog(log, SIM) as opened:
        assert (opened.count, opened.run) == (6, 1)
        opened.append(label(6))
    assert [(each.run, each.stored) for each in read_demonstrations(log)][-2:] == [(0, False), (1, True)]


def test_a_full_disk_leaves_the_log_as_it_was(log, monkeypatch):
    before, write = log.read_bytes(), os.write

    def full(file, data):
        if len(data) > 1000:
            return write(file, data[:1000])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(StorageError, match="No space left"):
        correct(log, [0, 1], stored=False)
    assert log.read_bytes() == before


class TestLastIntervention:
    def test_it_is_what_the_human_showed_in_a_row_at_last(self):
        labels = [label(0), label(1), label(2, "camera"), label(3), label(4, stored=False), label(5), label(6, "lidar")]
        assert last_intervention(labels) == [3, 5]
        assert last_intervention(labels[:3]) == [0, 1]
        assert last_intervention(labels[2:3]) == []

    def test_a_hand_that_was_off_for_a_while_has_come_back(self):
        labels = [label(0), label(1), label(20), label(21, "camera", stored=False), label(22, stored=False), label(26)]
        assert last_intervention(labels) == [2, 5]
        assert last_intervention([*labels, label(40, stored=False)]) == [2, 5]

    def test_it_ends_with_the_lap(self):
        assert last_intervention([label(0), label(1, lap=2), label(2, lap=2)]) == [1, 2]


class TestMerge:
    def test_the_second_log_s_runs_are_later_ones(self, tmp_path):
        one = written(tmp_path / "a", label(0), label(1))
        written(one, label(2))
        other = written(tmp_path / "b", label(0, "camera"), label(7))
        assert merge(one, other, tmp_path / "c") == (5, 0)
        found = [(each.run, each.source, each.observation) for each in read_demonstrations(tmp_path / "c")]
        assert found == [(0, "human", 0), (0, "human", 1), (1, "human", 2), (2, "camera", 0), (2, "human", 7)]
        assert check_log(tmp_path / "c").words() == ""

    def test_what_is_in_both_is_kept_once_and_taken_back_if_one_took_it_back(self, tmp_path):
        one = written(tmp_path / "a", label(0), label(1))
        other = tmp_path / "b"
        other.write_bytes(one.read_bytes())
        written(one, label(2))
        written(other, label(3))
        correct(other, [1], stored=False)
        assert merge(one, other, tmp_path / "c") == (4, 2)
        found = [(each.run, each.observation, each.stored) for each in read_demonstrations(tmp_path / "c")]
        assert found == [(0, 0, True), (0, 1, False), (1, 2, True), (3, 3, True)]

    def test_nothing_is_written_over_and_no_log_is_touched(self, log, tmp_path):
        before = log.read_bytes()
        with pytest.raises(StorageError, match="is there already"):
            merge(log, log, log)
        assert log.read_bytes() == before
        assert merge(log, log, tmp_path / "c") == (6, 6)

    def test_logs_of_different_robots_do_not_merge(self, log, tmp_path):
        other = written(tmp_path / "b", label(0, profile=REAL), profile=REAL)
        with pytest.raises(StorageError, match="different robots"):
            merge(log, other, tmp_path / "c")
        assert not (tmp_path / "c").exists()


def test_the_records_themselves_can_be_read(log):
    correct(log, [0], stored=False)
    assert [each.correction for each in read_records(log)] == [False] * 6 + [True]


def test_what_is_no_file_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path, tmp_path / "none"):
        with pytest.raises(StorageError):
            correct(path, [0], stored=False)
        with pytest.raises(StorageError):
            merge(path, path, tmp_path / "c")
