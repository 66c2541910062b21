"""Damaged demonstration logs: every intact label is found, never a wrong one, and nothing is deleted."""

import os
import struct
import zlib
from dataclasses import replace

import numpy as np
import pytest
from test_demonstrations import REAL, SIM, demonstration, holds, record_bytes, same, write

from lira.fusion.log.label_log import DemonstrationLog, check_log, read_demonstrations, repair_log
from lira.hal.errors import StorageError

COUNT = 8


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A whole log, the size of its header and of a record."""
    folder = tmp_path_factory.mktemp("log")
    write(folder / "log", range(COUNT))
    data, size = (folder / "log").read_bytes(), record_bytes(folder)
    return data, len(data) - COUNT * size, size


def remove_byte(data, at, _):
    return data[:at] + data[at + 1 :]


def add_byte(data, at, rng):
    return data[:at] + bytes([rng.integers(256)]) + data[at:]


def flip_bits(data, at, rng):
    return data[:at] + bytes([data[at] ^ int(rng.integers(1, 256))]) + data[at + 1 :]


def hole_of_zeros(data, at, rng):
    length = int(rng.integers(1, 4000))
    return (data[:at] + bytes(length) + data[at + length :])[: len(data)]


def missing_stretch(data, at, rng):
    return data[:at] + data[at + int(rng.integers(1, 4000)) :]


def foreign_bytes(data, at, rng):
    return data[:at] + rng.bytes(int(rng.integers(1, 4000))) + data[at:]


@pytest.mark.parametrize(
    "damage",
    [remove_byte, add_byte, flip_bits, hole_of_zeros, missing_stretch, foreign_bytes],
    ids=lambda d: d.__name__,
)
def test_all_intact_labels_are_found_and_no_wrong_one(tmp_path, log, damage):
    data, begin, size = log
    records = [data[begin + k * size :][:size] for k in range(COUNT)]
    rng = np.random.default_rng(1)
    for at in [begin, begin + size, len(data) - 1, *rng.integers(begin, len(data), 60).tolist()]:
        broken = damage(data, at, rng)
        path = tmp_path / "log"
        path.write_bytes(broken)
        assert holds(path, [k for k in range(COUNT) if records[k] in broken]), at


def test_two_logs_one_behind_the_other_are_one(tmp_path, log):
    data, begin, _ = log
    path = tmp_path / "log"
    path.write_bytes(data + data[: begin + 1] + data[begin:])  # and a byte too many behind the second header
    assert holds(path, [*range(COUNT), *range(COUNT)])
    path.write_bytes(data + data)
    assert holds(path, [*range(COUNT), *range(COUNT)])
    assert check_log(path).words() == ""


def test_opening_a_damaged_log_says_what_is_lost_and_keeps_the_old_file(tmp_path, log):
    data, begin, size = log
    path = tmp_path / "log"
    broken = remove_byte(data, begin + 2 * size + 700, None)
    path.write_bytes(broken)
    said = []
    with DemonstrationLog(path, SIM, say=said.append) as opened:
        assert (opened.count, opened.run, opened.repaired_bytes) == (COUNT - 1, 1, 0)
        opened.append(demonstration(COUNT))
    kept = tmp_path / "log.damaged"
    assert said == [
        f"{path}: {size - 1} bytes cannot be read (at byte {begin + 2 * size}); {COUNT - 1} labels read, "
        f"the old file is kept as {kept}"
    ]
    assert kept.read_bytes() == broken
    assert holds(path, [0, 1, *range(3, COUNT + 1)])
    path.write_bytes(broken)
    DemonstrationLog(path, SIM, say=said.append).close()
    assert (tmp_path / "log.damaged-2").read_bytes() == kept.read_bytes() == broken
    assert {entry.name for entry in tmp_path.iterdir()} == {"log", "log.damaged", "log.damaged-2"}


def test_a_healed_log_is_still_locked(tmp_path, log):
    data, begin, _ = log
    path = tmp_path / "log"
    path.write_bytes(flip_bits(data, begin + 1, np.random.default_rng(0)))
    with DemonstrationLog(path, SIM, say=lambda _: None), pytest.raises(StorageError, match="in use"):
        DemonstrationLog(path, SIM)


def test_a_damaged_last_record_is_kept_too(tmp_path, log):
    """It is as long as a record: no torn write."""
    data, _, _ = log
    path = tmp_path / "log"
    path.write_bytes(flip_bits(data, len(data) - 9, np.random.default_rng(0)))
    with DemonstrationLog(path, SIM, say=lambda _: None) as opened:
        assert (opened.count, opened.repaired_bytes) == (COUNT - 1, 0)
    assert (tmp_path / "log.damaged").stat().st_size == len(data)


def test_damage_that_cannot_be_healed_leaves_the_file(tmp_path, log, monkeypatch):
    data, begin, _ = log
    path = tmp_path / "log"
    broken = remove_byte(data, begin + 700, None)
    path.write_bytes(broken)

    def full(_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("lira.fusion.log.label_salvage.os.fsync", full)
        with pytest.raises(StorageError, match=r"damaged .* cannot be written anew: No space left") as refused:
            DemonstrationLog(path, SIM)
    assert "left as it is" in refused.value.remedy
    assert path.read_bytes() == broken
    assert [entry.name for entry in tmp_path.iterdir()] == ["log"]


def sealed(body: bytes) -> bytes:
    return body + struct.pack("<I", zlib.crc32(body))


@pytest.mark.parametrize(
    ("at", "value"),
    [
        (0, struct.pack("<d", np.nan)),
        (53, struct.pack("<d", np.nan)),
        (61, struct.pack("<d", 1e308)),
        (69, struct.pack("<d", np.inf)),
        (77, struct.pack("<d", -7.0)),
        (21, b"\xff\xfe\x00"),
        (21, bytes(32)),
        (20, b"\x80"),
        (85, struct.pack("<f", np.nan)),
        (89, struct.pack("<f", 1e30)),
    ],
)
def test_sealed_nonsense_is_damage(tmp_path, log, at, value):
    data, begin, size = log
    start = begin + 3 * size
    body = data[start : start + size - 4]
    broken = data[:start] + sealed(body[:at] + value + body[at + len(value) :]) + data[start + size :]
    (tmp_path / "log").write_bytes(broken)
    assert holds(tmp_path / "log", [0, 1, 2, 4, 5, 6, 7])
    assert check_log(tmp_path / "log").lost_bytes == size


@pytest.mark.parametrize("action", [(np.nan, 0.0), (0.0, 1e308), (2.0, 0.0)])
def test_nonsense_is_not_stored(tmp_path, action):
    with DemonstrationLog(tmp_path / "log", SIM) as opened, pytest.raises(ValueError, match="actions"):
        opened.append(replace(demonstration(0), action=action))
    assert holds(tmp_path / "log", [])


@pytest.mark.parametrize("name", [b"\xff\xfe", b"a\nb", b""])
def test_a_sealed_header_with_a_name_that_is_none_is_damaged(tmp_path, name):
    path = tmp_path / "log"
    path.write_bytes(sealed(struct.pack("<8sHHHH", b"LIRADEMO", 1, 101, 32, len(name)) + name))
    with pytest.raises(StorageError, match=r"header .* damaged"):
        DemonstrationLog(path, SIM)
    with pytest.raises(StorageError, match=r"header .* damaged"):
        list(read_demonstrations(path))


def test_a_header_that_claims_huge_records_is_damaged(tmp_path):
    path = tmp_path / "log"
    path.write_bytes(sealed(struct.pack("<8sHHHH", b"LIRADEMO", 1, 65535, 65535, 1) + b"x") + bytes(9000))
    with pytest.raises(StorageError, match=r"header .* damaged"):
        list(read_demonstrations(path))


def test_a_log_with_a_damaged_header_is_left_alone_and_can_be_repaired(tmp_path, log):
    data, begin, _ = log
    path = tmp_path / "log"
    for broken in (data[1:], b"x" + data, flip_bits(data, 13, np.random.default_rng(0)), data[begin + 5 :]):
        path.write_bytes(broken)
        with pytest.raises(StorageError):
            DemonstrationLog(path, SIM)
        assert path.read_bytes() == broken
        whole = range(COUNT) if data[begin:] in broken else range(1, COUNT)
        found, kept = repair_log(path, [REAL, SIM])
        assert found.form.profile == "thesis-sim"
        assert found.count == len(whole)
        assert kept.read_bytes() == broken
        assert holds(path, whole)
        assert repair_log(path) == (check_log(path), None)


def test_a_log_in_use_is_not_repaired_but_may_be_checked(tmp_path):
    path = tmp_path / "log"
    with DemonstrationLog(path, SIM) as opened:
        opened.append(demonstration(0))
        assert check_log(path).count == 1
        with pytest.raises(StorageError, match="in use"):
            repair_log(path)


def test_a_pipe_and_a_device_are_no_logs(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zeros").symlink_to("/dev/zero")
    for name in ("pipe", "zeros"):
        for use in (lambda path: DemonstrationLog(path, SIM), lambda path: list(read_demonstrations(path)), check_log):
            with pytest.raises(StorageError):
                use(tmp_path / name)


def keep(path, numbers, spoil):
    """Append labels; before each of `spoil` somebody does something to the file. Returns the log's path and words."""
    said = []
    with DemonstrationLog(path, SIM, say=said.append) as opened:
        for k in numbers:
            if k in spoil:
                spoil[k](path)
            opened.append(demonstration(k))
    return opened.path, said


@pytest.mark.parametrize("at", [0, 3])
def test_a_log_that_is_removed_while_it_is_written_is_written_again(tmp_path, at):
    path = tmp_path / "run" / "log"
    where, said = keep(path, range(5), {at: lambda path: (path.unlink(), path.parent.rmdir())})
    assert where == path
    assert said == [f"somebody took {path} away while it was written; all labels are in {path}"]
    assert holds(path, range(5))


def test_a_log_that_is_removed_after_the_last_label_is_written_again(tmp_path):
    path = tmp_path / "log"
    with DemonstrationLog(path, SIM, say=lambda _: None) as opened:
        opened.append(demonstration(0))
        path.unlink()
    assert holds(path, [0])


def test_a_log_in_whose_place_there_is_another_file_goes_on_beside_it(tmp_path):
    path = tmp_path / "log"

    def replace_it(path):
        (tmp_path / "other").write_bytes(b"mine")
        (tmp_path / "other").replace(path)

    where, said = keep(path, range(5), {2: replace_it})
    assert where == tmp_path / "log.new"
    assert len(said) == 1
    assert holds(where, range(5))
    assert path.read_bytes() == b"mine"


@pytest.mark.parametrize("length", [0, 7, 1000, 2600])
def test_a_log_that_is_cut_while_it_is_written_is_noticed(tmp_path, log, length):
    _, begin, size = log
    where, said = keep(tmp_path / "log", range(5), {3: lambda path: os.truncate(path, length)})
    assert len(said) == 1
    assert "changed by somebody else" in said[0]
    assert holds(where, [*range(max(length - begin, 0) // size), 3, 4])


def test_a_large_damaged_log_is_read_within_seconds(tmp_path, log):
    data, begin, _ = log
    rng = np.random.default_rng(0)
    path = tmp_path / "log"
    path.write_bytes(data + bytes(20_000_000) + rng.bytes(2_000_000) + data[begin:])
    found = check_log(path)
    assert found.count == 2 * COUNT
    assert found.lost_bytes == 22_000_000
    assert all(same(one, demonstration(k % COUNT)) for k, one in enumerate(read_demonstrations(path)))
