import json
import os
import signal
import struct
import subprocess
import sys
import textwrap
import time
import zlib
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from lira.fusion.log.label_file import Format
from lira.fusion.log.label_log import Demonstration, DemonstrationLog, read_demonstrations
from lira.fusion.preprocess import Features, shapes_of
from lira.hal.errors import StorageError
from lira.hal.profile import Depth, load_profile
from lira.hal.words import plural

SIM = load_profile("thesis-sim")
REAL = load_profile("rosbot2")


def demonstration(k: int = 0, profile=SIM) -> Demonstration:
    rng = np.random.default_rng(k)
    arrays = {
        name: rng.random(shape, dtype=np.float32)
        if name == "scan"
        else (rng.integers(0, 256, shape) / 255).astype(np.float32)
        for name, shape in shapes_of(profile).items()
    }
    return Demonstration(
        stamp_s=0.2 * k,
        observation=k,
        lap=k % 3,
        source=("human", "camera", "lidar", "mean")[k % 4],
        action=(0.1 * (k % 10), -1.0),
        novice=(0.5, 1 / 3),
        stored=k % 2 == 0,
        features=Features(**arrays),
    )


def same(one: Demonstration, other: Demonstration) -> bool:
    mine, theirs = one.features, other.features
    arrays = mine.keys() == theirs.keys() and all(np.array_equal(mine[name], theirs[name]) for name in mine)
    return arrays and replace(one, features=None, run=0) == replace(other, features=None, run=0)


def write(path: Path, numbers, profile=SIM) -> None:
    with DemonstrationLog(path, profile) as log:
        for k in numbers:
            log.append(demonstration(k, profile))


def holds(path: Path, numbers, profile=SIM) -> bool:
    found = list(read_demonstrations(path))
    wanted = [demonstration(k, profile) for k in numbers]
    return len(found) == len(wanted) and all(map(same, found, wanted))


def record_bytes(tmp_path: Path) -> int:
    sizes = []
    for count in (0, 1):
        write(tmp_path / f"size{count}", range(count))
        sizes.append((tmp_path / f"size{count}").stat().st_size)
    return sizes[1] - sizes[0]


@pytest.mark.parametrize("profile", [SIM, REAL])
def test_what_is_appended_is_read_exactly_also_after_reopening(tmp_path, profile):
    path = tmp_path / "new" / "labels.demo"
    write(path, range(5), profile)
    with DemonstrationLog(path, profile) as log:
        assert (log.count, log.repaired_bytes) == (5, 0)
        log.append(demonstration(5, profile))
        assert holds(path, range(6), profile)  # readable while it is open
    assert holds(path, range(6), profile)


def test_reading_streams(tmp_path):
    write(tmp_path / "log", range(3))
    records = read_demonstrations(tmp_path / "log")
    assert same(next(records), demonstration(0))
    assert same(next(records), demonstration(1))


WRITER = """
    import sys
    from pathlib import Path
    from test_demonstrations import SIM, demonstration
    from lira.fusion.log.label_log import DemonstrationLog
    log = DemonstrationLog(Path(sys.argv[1]), SIM)
    k = log.count
    while True:
        log.append(demonstration(k))
        print(k, flush=True)
        k += 1
"""


def start(script: str, *arguments: object) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    command = [sys.executable, "-c", textwrap.dedent(script), *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


def test_labels_survive_kill_9(tmp_path):
    path = tmp_path / "log"
    rng = np.random.default_rng(1)
    for _ in range(4):
        writer = start(WRITER, path)
        first = writer.stdout.readline()
        time.sleep(0.05 * rng.random())
        os.kill(writer.pid, signal.SIGKILL)
        said, complaints = writer.communicate()
        assert first, complaints
        last = int((first + said).split("\n")[:-1][-1])  # a label it said it had stored
        count = len(list(read_demonstrations(path)))
        assert count >= last + 1
        with DemonstrationLog(path, SIM) as log:
            assert log.count == count
    assert count > 10
    assert holds(path, range(count))


def test_a_torn_tail_is_cut_off_and_reported(tmp_path):
    whole = tmp_path / "whole"
    write(whole, range(4))
    data, size = whole.read_bytes(), record_bytes(tmp_path)
    for cut in (1, 2, size // 2, size - 1):
        torn = tmp_path / f"torn{cut}"
        torn.write_bytes(data[:-cut])
        assert holds(torn, range(3))
        with DemonstrationLog(torn, SIM) as log:
            assert (log.count, log.repaired_bytes) == (3, size - cut)
            log.append(demonstration(3))
        assert holds(torn, range(4))
        assert torn.read_bytes()[: len(data) - size] == data[: len(data) - size]


def test_a_tail_of_zeros_after_a_power_cut_is_cut_off(tmp_path):
    path = tmp_path / "log"
    write(path, range(2))
    data = path.read_bytes()
    path.write_bytes(data + bytes(5000))
    with DemonstrationLog(path, SIM) as log:
        assert (log.count, log.repaired_bytes) == (2, 5000)
    assert path.read_bytes() == data


def test_a_header_torn_in_the_first_write_is_written_anew(tmp_path):
    path = tmp_path / "log"
    write(path, [])
    header = path.read_bytes()
    for keep in range(len(header)):
        path.write_bytes(header[:keep])
        write(path, range(2))
        assert holds(path, range(2))


def test_a_second_copy_is_refused(tmp_path):
    path = tmp_path / "log"
    with DemonstrationLog(path, SIM) as log:
        log.append(demonstration(0))
        with pytest.raises(StorageError, match="in use by another process") as refused:
            DemonstrationLog(path, SIM)
        assert "another file" in refused.value.remedy
        writer = start(WRITER, path)
        assert "in use by another process" in writer.communicate(timeout=60)[1]
        assert writer.returncode == 1
        log.append(demonstration(1))
    assert holds(path, range(2))


def test_a_log_of_another_robot_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "log"
    write(path, range(2))
    before = path.read_bytes()
    with pytest.raises(StorageError, match=r"'thesis-sim' \(scan 101, image 32x32\), not for 'rosbot2' \(scan 130"):
        DemonstrationLog(path, REAL)
    assert path.read_bytes() == before


@pytest.mark.parametrize("content", [b"hello", b"\0" * 4000, b"LIRADEMO" + b"\xff" * 100])
def test_a_file_that_is_no_log_is_refused_and_left_alone(tmp_path, content):
    path = tmp_path / "notes.txt"
    path.write_bytes(content)
    with pytest.raises(StorageError):
        DemonstrationLog(path, SIM)
    with pytest.raises(StorageError):
        list(read_demonstrations(path))
    assert path.read_bytes() == content


def test_a_missing_file_and_a_folder_are_storage_errors(tmp_path):
    with pytest.raises(StorageError, match="cannot read"):
        list(read_demonstrations(tmp_path / "none"))
    with pytest.raises(StorageError, match="cannot open"):
        DemonstrationLog(tmp_path, SIM)


def test_features_of_another_size_are_refused(tmp_path):
    with DemonstrationLog(tmp_path / "log", SIM) as log:
        with pytest.raises(ValueError, match="does not fit"):
            log.append(demonstration(0, REAL))
        log.append(demonstration(0))
    assert holds(tmp_path / "log", range(1))


LIMITED_WRITER = """
    import json, resource, signal, sys
    from pathlib import Path
    from test_demonstrations import SIM, demonstration
    from lira.fusion.log.label_log import DemonstrationLog
    from lira.hal.errors import StorageError
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, resource.RLIM_INFINITY))
    errors = []
    with DemonstrationLog(Path(sys.argv[1]), SIM) as log:
        for k in range(20):
            try:
                log.append(demonstration(k))
            except StorageError as error:
                errors.append((k, str(error), Path(sys.argv[1]).stat().st_size))
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    print(json.dumps(errors))
"""


def test_a_file_that_cannot_grow_is_reported_keeps_whole_records_and_goes_on_when_it_can(tmp_path):
    path = tmp_path / "log"
    writer = start(LIMITED_WRITER, path)
    said, complaints = writer.communicate(timeout=60)
    assert writer.returncode == 0, complaints
    errors = json.loads(said)
    size = record_bytes(tmp_path)
    assert [k for k, _, _ in errors] == list(range(errors[0][0], 20))
    assert 0 < errors[0][0] < 20
    for number, (_, message, length) in enumerate(errors, start=1):
        assert f"File too large; in memory: {plural(number, 'label')}" in message
        assert length == path.stat().st_size - size * len(errors)  # the partial write was taken back
    assert holds(path, range(20))


def test_a_disk_that_fills_up_is_reported_while_labels_still_fit(tmp_path, monkeypatch):
    path = tmp_path / "log"
    with DemonstrationLog(path, SIM) as log:
        log.append(demonstration(0))
        disk = os.statvfs(tmp_path)
        nearly_full = os.statvfs_result((*disk[:4], 300_000 // disk.f_frsize, *disk[5:]))
        monkeypatch.setattr("os.fstatvfs", lambda _: nearly_full)
        with pytest.raises(StorageError, match=r"nearly full: 2.. kB"):
            log.append(demonstration(1))
    assert holds(path, range(2))
    with pytest.raises(StorageError, match="nearly full"):
        DemonstrationLog(path, SIM)
    assert holds(path, range(2))


def test_the_provenance_of_a_label_is_kept_over_several_runs(tmp_path):
    path = tmp_path / "log"
    rest = replace(demonstration(0), action=(0.0, 0.0))
    for mirrored in (False, True):
        with DemonstrationLog(path, SIM, mirrored=mirrored) as log:
            log.append(rest)
            log.append(demonstration(1))  # an expert's, and not stored
    found = list(read_demonstrations(path))
    assert [(each.run, each.mirrored, each.idle) for each in found] == [
        (0, False, True),
        (0, False, False),
        (1, True, True),
        (1, False, False),
    ]
    assert [(each.source, each.lap, each.observation) for each in found[:2]] == [("human", 0, 0), ("camera", 1, 1)]


def test_a_log_from_before_runs_were_counted_is_read_as_it_was(tmp_path):
    """Then the lap took four bytes and whether it was stored one."""
    path = tmp_path / "log"
    write(path, [5])
    with DemonstrationLog(path, SIM) as log:
        log.append(demonstration(0))
    size = record_bytes(tmp_path)
    data = path.read_bytes()
    record = data[-2 * size : -size]
    assert struct.unpack_from("<dqi?", record) == (1.0, 5, 2, False)
    assert [(each.lap, each.run) for each in read_demonstrations(path)] == [(2, 0), (0, 1)]


def first_version(path: Path, numbers) -> None:
    """Write a log as it was before features had names: two sizes in the header, the same records."""
    write(path, numbers)
    header = struct.pack("<8sHHHH", b"LIRADEMO", 1, 101, 32, len(SIM.name)) + SIM.name.encode()
    begin = len(Format.of(SIM).header())
    path.write_bytes(header + struct.pack("<I", zlib.crc32(header)) + path.read_bytes()[begin:])


def test_a_log_of_the_first_version_is_read_and_goes_on_as_it_is(tmp_path):
    path = tmp_path / "log"
    first_version(path, range(3))
    assert holds(path, range(3))
    before = path.read_bytes()
    with DemonstrationLog(path, SIM) as log:
        assert (log.count, log.run, log.repaired_bytes) == (3, 1, 0)
        log.append(demonstration(3))
    assert path.read_bytes().startswith(before)
    assert holds(path, range(4))


def test_a_damaged_log_of_the_first_version_is_healed(tmp_path):
    path = tmp_path / "log"
    first_version(path, range(3))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    DemonstrationLog(path, SIM, say=lambda _: None).close()
    assert holds(path, [0, 2])


def test_a_log_holds_whatever_features_the_profile_chooses(tmp_path):
    depth = Depth(width_px=64, height_px=48, range_min_m=0.1, range_max_m=4.0)
    shape = msgspec.structs.replace(SIM.features, inputs=("image", "scan", "depth"))
    robot = msgspec.structs.replace(SIM, depth=depth, features=shape)
    write(tmp_path / "log", range(4), robot)
    assert holds(tmp_path / "log", range(4), robot)
    with pytest.raises(StorageError, match=r"image 32x32, depth 32x32\), not for 'thesis-sim' \(scan 101, im"):
        DemonstrationLog(tmp_path / "log", SIM)
