"""The recorder beside a bus that is not there: what it writes, loses, and says about the disk."""

import errno
import threading
import time

import pytest
from samples import HEAD, drive, odom, picture

from lira.hal.bus.topics import CAMERA, ODOM
from lira.hal.errors import LiraError, StorageError
from lira.tools.recording import recorder as module
from lira.tools.recording.reader import Recording
from lira.tools.recording.recorder import Recorder
from lira.tools.recording.writer import RecordingWriter

ROOM = 100 * 2**30


class ATap:
    """Gives what it has, then sets `over`."""

    full = False

    def __init__(self, *polls):
        self._polls, self.over = list(polls), threading.Event()

    def poll(self):
        if not self._polls:
            self.over.set()
            return []
        return self._polls.pop(0)


@pytest.fixture(autouse=True)
def _room(monkeypatch):
    monkeypatch.setattr(module, "free_bytes", lambda _: ROOM)
    monkeypatch.setattr(module, "LAST_S", 0.02)


def record(folder, tap, *, most_bytes=2**30, writer=RecordingWriter):
    said = []
    recorder = Recorder(tap, writer(folder, HEAD, split_bytes=2**30), HEAD, said.append, most_bytes=most_bytes)
    recorder.run(tap.over, [odom(0, 5.0)])
    return recorder, said


def keys(folder):
    return [each.key for each in Recording(folder).messages()]


def test_what_was_heard_before_and_what_comes_is_written_in_order(tmp_path):
    sent = list(drive(1))
    recorder, said = record(tmp_path / "rec", ATap(sent[:10], sent[10:]))
    assert keys(tmp_path / "rec") == [ODOM.key, *(each.key for each in sent)]
    assert recorder.count == len(sent) + 1
    assert not said


def test_pictures_that_a_slow_disk_has_no_time_for_are_lost_and_that_is_said_and_written(tmp_path, monkeypatch):
    class SlowWriter(RecordingWriter):
        def add(self, *arguments):
            time.sleep(0.05)  # by then the next poll has brought more than may wait
            super().add(*arguments)

    flood = [picture(number, 5.0) for number in range(20)] + [odom(1, 5.1)]
    recorder, said = record(tmp_path / "rec", ATap(flood), most_bytes=10_000, writer=SlowWriter)
    recording = Recording(tmp_path / "rec")
    found = [each.key for each in recording.messages()]
    assert found.count(ODOM.key) == 2
    assert 0 < found.count(CAMERA.key) < 20
    assert recording.losses == {CAMERA.key: 20 - found.count(CAMERA.key)} == dict(recorder.lost)
    assert any("not recorded, the disk is too slow" in line for line in said)


def test_a_disk_that_comes_to_its_end_is_said_before_it_is_full(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "free_bytes", lambda _: module.SPARE_BYTES + 1000)
    _, said = record(tmp_path / "rec", ATap([odom(1, 5.0)]))
    assert any("room for 0 min more of this" in line for line in said)


def test_with_no_room_but_what_belongs_to_labels_it_ends_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "free_bytes", lambda _: module.SPARE_BYTES - 1)
    with pytest.raises(StorageError, match="less than 200 MB left"):
        record(tmp_path / "rec", ATap([odom(1, 5.0)]))
    recording = Recording(tmp_path / "rec")
    assert [each.key for each in recording.messages()]
    assert not recording.torn


@pytest.mark.parametrize("free", [0, 1000, module.SPARE_BYTES])
def test_a_disk_without_room_is_said_to_have_none_and_no_time_is_counted_backwards(tmp_path, monkeypatch, free):
    said = []
    monkeypatch.setattr(module, "free_bytes", lambda _: free)
    tap = ATap([odom(1, 5.0)])
    writer = RecordingWriter(tmp_path / "rec", HEAD, split_bytes=2**30)
    recorder = Recorder(tap, writer, HEAD, said.append, most_bytes=2**30)
    with pytest.raises(StorageError, match="no room is left for more, and the recording ends") as ended:
        recorder.run(tap.over, [])
    assert "what was recorded stays" in str(ended.value)
    assert not said


def test_a_disk_that_takes_nothing_more_ends_it_and_what_was_written_stays(tmp_path):
    class FullDisk(RecordingWriter):
        def flush(self):
            super().flush()
            if self._now.count > 2:
                raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(StorageError, match="No space left on device"):
        record(tmp_path / "rec", ATap([odom(1, 5.0), odom(2, 5.1)], *[[]] * 200), writer=FullDisk)
    assert keys(tmp_path / "rec") == [ODOM.key] * 3


def test_more_than_is_kept_between_two_polls_may_be_lost_and_is_counted(tmp_path):
    tap = ATap([odom(1, 5.0)])
    tap.full = True
    recorder, _ = record(tmp_path / "rec", tap)
    assert recorder.lost["**"] >= 1


def test_an_attachment_that_is_out_of_bounds_is_recorded_and_not_believed(tmp_path):
    bad = odom(1, 5.0)
    bad = type(bad)(bad.key, bad.ros_type, bad.payload, bad.attachment[:12] + b"\xff" * 25, 0.0)
    assert module.attachment_of(bad) is None
    record(tmp_path / "rec", ATap([bad]))
    assert [each.beside for each in Recording(tmp_path / "rec").messages()][-1] == bad.attachment


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_fault_of_the_recorders_own_is_no_recording(tmp_path):
    class Faulty(RecordingWriter):
        def add(self, *arguments):
            raise RuntimeError("nobody foresaw it")

    with pytest.raises(LiraError, match="the recorder failed"):
        record(tmp_path / "rec", ATap([odom(1, 5.0)]), writer=Faulty)
