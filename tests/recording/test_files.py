"""Recordings on disk: what is written is read again to the byte, also by others, and of a torn file what is whole."""

from dataclasses import replace

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader
from samples import BEGAN_NS, EPOCH, HEAD, OFFSET_NS, battery, drive, odom, picture, sample, write

from lira.hal.bus.topics import BATTERY, CAMERA, DESCRIPTION, ODOM, SCAN
from lira.hal.errors import StorageError
from lira.hal.messages import Odometry, Text
from lira.hal.messages.ros.types import TYPES
from lira.tools.cli import main
from lira.tools.recording.layout import FOLDER
from lira.tools.recording.reader import Recording
from lira.tools.recording.recover import recover
from lira.tools.recording.summary import summarise
from lira.tools.recording.writer import RecordingWriter

COUNTED = replace(ODOM, key="counted")


def as_heard(recording, *topics):
    return [(each.key, each.ros_type, each.payload, each.beside) for each in recording.messages(*topics)]


def as_sent(samples):
    return [(each.key, each.ros_type, each.payload, each.attachment) for each in samples]


def test_what_was_heard_is_read_again_to_the_byte_in_its_order(tmp_path):
    write(tmp_path / "rec", drive(5))
    recording = Recording(tmp_path / "rec")
    assert as_heard(recording) == as_sent(drive(5))
    assert recording.head == HEAD
    assert not recording.torn


def test_a_message_is_decoded_with_its_times_on_the_robots_clock(tmp_path):
    write(tmp_path / "rec", [odom(7, 6.5)])
    (found,) = Recording(tmp_path / "rec").messages(ODOM)
    assert found.message == Odometry(6.49, 7.0, 0.0, 0.0, 0.1, 0.0)
    assert (found.stamp_s, found.sent_s) == (6.49, 6.5)
    assert found.arrived_s == (BEGAN_NS - OFFSET_NS) / 1e9
    assert (found.attachment.epoch, found.attachment.seq) == (EPOCH, 7)


def test_a_message_of_a_ros_peer_and_one_of_a_type_nobody_knows_are_kept_as_they_are(tmp_path):
    foreign = sample(ODOM, Odometry(1.0, 0.0, 0.0, 0.0, 0.0, 0.0), attachment=False)
    unknown = type(foreign)("their/topic", "their_msgs/msg/Thing", b"\0\1\0\0abcd", b"not ours", 0.0)
    write(tmp_path / "rec", [foreign, unknown])
    assert as_heard(Recording(tmp_path / "rec")) == as_sent([foreign, unknown])


def test_only_the_topics_and_the_times_that_were_asked_for_are_read(tmp_path):
    write(tmp_path / "rec", drive(5))
    recording = Recording(tmp_path / "rec")
    assert as_heard(recording, SCAN, "battery") == as_sent(s for s in drive(5) if s.key in (SCAN.key, BATTERY.key))
    some = [each.arrived_s for each in recording.messages(since_s=5.05, until_s=5.1)]
    assert len(some) == 51
    assert min(some) >= 5.05
    assert max(some) <= 5.1


def test_a_large_recording_is_split_and_read_as_one(tmp_path):
    writer = write(tmp_path / "rec", drive(20), split_bytes=100_000)
    assert writer.files > 3
    recording = Recording(tmp_path / "rec")
    assert len(recording.files) == writer.files
    assert as_heard(recording) == as_sent(drive(20))
    assert Recording(recording.files[2]).head.part == 2


def test_the_recording_of_a_run_is_found_by_the_runs_folder(tmp_path):
    write(tmp_path / FOLDER, [odom(0, 5.0)])
    assert as_heard(Recording(tmp_path)) == as_sent([odom(0, 5.0)])


def test_nothing_is_written_over_and_where_there_is_nothing_that_is_said(tmp_path):
    write(tmp_path / "rec", [odom(0, 5.0)])
    with pytest.raises(StorageError, match="already holds a recording"):
        RecordingWriter(tmp_path / "rec", HEAD, split_bytes=1000)
    with pytest.raises(StorageError, match="there is no recording"):
        Recording(tmp_path / "nothing")
    (tmp_path / "other.mcap").write_bytes(b"something else altogether")
    with pytest.raises(StorageError, match="is no recording"):
        Recording(tmp_path / "other.mcap")


# Others' readers.


def test_rosbag2s_reader_opens_it_with_its_metadata(tmp_path):
    write(tmp_path / "rec", drive(5), split_bytes=100_000)
    with Reader(tmp_path / "rec") as reader:
        counts = {topic: info.msgcount for topic, info in reader.topics.items()}
        assert counts["/rosbot/odom"] == 100
        assert counts["/rosbot/scan"] == counts["/rosbot/camera/color/image_raw/compressed"] == 50
        connections = [each for each in reader.connections if each.topic == "/rosbot/odom"]
        found = [TYPES.deserialize_cdr(data, c.msgtype) for c, _, data in reader.messages(connections)]
        assert [message.pose.pose.position.x for message in found] == list(range(100))
        (latched,) = next(
            each for each in reader.connections if each.topic == "/rosbot/battery"
        ).ext.offered_qos_profiles
        assert latched.durability.name == "TRANSIENT_LOCAL"


def test_mcaps_own_reader_decodes_every_message_by_the_definitions_inside(tmp_path):
    writer = write(tmp_path / "rec", drive(2))
    with writer.folder.joinpath("rec_0.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        decoded = list(reader.iter_decoded_messages())
        assert {channel.topic for _, channel, _, _ in decoded} >= {"/rosbot/scan", "/rosbot/lira/attachment"}
        scans = [message for _, channel, _, message in decoded if channel.topic == "/rosbot/scan"]
        assert np.allclose(scans[0].ranges, 1.5)
        assert reader.get_summary().statistics.message_count == len(decoded)


# What was cut off.


def test_of_a_file_without_an_end_all_that_was_flushed_is_read(tmp_path):
    write(tmp_path / "rec", drive(5), close=False)
    recording = Recording(tmp_path / "rec")
    assert as_heard(recording) == as_sent(drive(5))
    assert recording.torn == recording.files


@pytest.mark.parametrize("share", [0.999, 0.9, 0.51, 0.2])
def test_of_a_file_cut_anywhere_what_is_whole_is_read(tmp_path, share):
    folder = tmp_path / "rec"
    write(folder, drive(60))
    path = folder / "rec_0.mcap"
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    recording, sent = Recording(folder), as_sent(drive(60))
    found = as_heard(recording)
    assert found == sent[: len(found)]
    assert len(found) >= (share - 0.25) * len(sent)
    assert recording.torn == [path]


def test_a_file_with_flipped_bits_is_read_up_to_them(tmp_path):
    folder = tmp_path / "rec"
    write(folder, drive(20))
    path = folder / "rec_0.mcap"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0x40
    path.write_bytes(data)
    recording = Recording(folder)
    found = as_heard(recording)
    assert 0 < len(found) < len(as_sent(drive(20)))
    assert found == as_sent(drive(20))[: len(found)]
    assert recording.torn == [path]


def test_a_recovered_recording_is_whole_for_everybody(tmp_path):
    folder = tmp_path / "rec"
    write(folder, drive(5), close=False)
    assert not (folder / "metadata.yaml").exists()
    lines = list(recover(folder))
    assert "mended, 201 messages" in lines[0]
    recording = Recording(folder)
    assert as_heard(recording) == as_sent(drive(5))
    assert not recording.torn
    with Reader(folder) as reader:
        assert reader.topics["/rosbot/odom"].msgcount == 100
    assert "whole, 201 messages" in next(recover(folder))
    assert summarise(recording).count == 201


# What it sums up to.


def test_a_summary_counts_by_topic_and_says_what_is_missing(tmp_path):
    numbers = [0, 1, 2, 6, 7]
    answers = [sample(COUNTED, Odometry(1.0, 0.0, 0.0, 0.0, 0.0, 0.0), seq=n, sent_s=5.0 + n) for n in numbers]
    write(tmp_path / "rec", [battery(1.0), *answers, picture(9, 13.0)])  # the battery told before it was recorded
    summary = summarise(Recording(tmp_path / "rec"))
    assert summary.count == 7
    assert summary.duration_s == 8.0
    counted = summary.topics["counted"]
    assert (counted.count, counted.missing, counted.gap_s) == (5, 3, 4.0)
    assert counted.rate_hz == pytest.approx(4 / 7)
    assert summary.topics[CAMERA.key].missing is None


def test_what_is_sent_once_is_said_to_be_so_and_not_to_be_missing(tmp_path, capsys):
    numbers = [0, 1, 2, 6, 7]
    answers = [sample(COUNTED, Odometry(1.0, 0.0, 0.0, 0.0, 0.0, 0.0), seq=n, sent_s=5.0 + n) for n in numbers]
    described = sample(DESCRIPTION, Text("<robot/>"))
    write(tmp_path / "rec", [battery(1.0), described, *answers, picture(9, 13.0), picture(10, 13.1)])
    assert main(["info", str(tmp_path / "rec")]) == 0
    rows = {line.split()[0]: line.split() for line in capsys.readouterr().out.splitlines() if "/msg/" in line}
    assert rows[DESCRIPTION.key][3:] == ["once", "0", "kB", "none"]
    assert rows["counted"][-1] == "3"
    assert rows[CAMERA.key][-1] == "-"


def test_what_the_recorder_lost_is_in_the_file(tmp_path):
    writer = RecordingWriter(tmp_path / "rec", HEAD, split_bytes=2**30)
    writer.add(odom(0, 5.0), BEGAN_NS, BEGAN_NS)
    writer.note_losses({CAMERA.key: 2}, BEGAN_NS)
    writer.note_losses({CAMERA.key: 5}, BEGAN_NS)
    writer.close()
    assert summarise(Recording(tmp_path / "rec")).lost == {CAMERA.key: 5}
