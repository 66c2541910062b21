"""Data sets and bags of others as labels: what was shown is what is learned, and what does not fit is told."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
from heard import LENGTHS, PERIOD_S, PROFILE, Message, cameras, picture, recording, scan, stamp
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from lira.fusion.log.label_log import read_demonstrations
from lira.fusion.modalities.depth import near_depth
from lira.fusion.preprocess import Features, Preprocessor
from lira.hal.bus.topics import DEPTH
from lira.hal.errors import ConfigError, StorageError
from lira.hal.messages import (
    Applied,
    CompressedImage,
    DepthImage,
    LaserScan,
    Observation,
    Reason,
    Source,
    Twist,
    TwistStamped,
)
from lira.hal.messages.compression import compress_depth
from lira.hal.messages.ros.codec import CODECS, encode, ros_type_of
from lira.hal.messages.ros.types import TYPES
from lira.hal.profile import load_profile
from lira.tools.cli import main
from lira.tools.export.bag_reader import choose, read_bag
from lira.tools.export.columns import SCAN, tables_of
from lira.tools.export.demonstrations import Shown, keep
from lira.tools.export.lerobot import PICTURES, write_lerobot
from lira.tools.export.lerobot_reader import features_for, read_info, read_lerobot
from lira.tools.export.pictures import depth_pictures
from lira.tools.export.robomimic import write_robomimic
from lira.tools.export.steps import episodes_of, steps_of

BASE = PROFILE.base
CAMERA = f"{PICTURES}camera"
VIDEO = {"dtype": "video", "shape": [8, 8, 3]}
SCAN_TYPE, PICTURE_TYPE, TWIST_TYPE = (ros_type_of(kind) for kind in (LaserScan, CompressedImage, Twist))


def features(number):
    """What a robot here sees at a step."""
    return Preprocessor(PROFILE)(Observation(number, stamp(number), scan=scan(number), image=picture(number)))


@pytest.fixture(scope="module")
def data_set(tmp_path_factory):
    folder = tmp_path_factory.mktemp("set") / "run"
    tables = tables_of(list(episodes_of(steps_of(recording()))), PROFILE)
    write_lerobot(tables, cameras(), folder, robot="thesis-sim", task="t", fps=5)
    return folder


def test_what_was_exported_comes_back(data_set):
    shown = list(read_lerobot(data_set, PROFILE, "all"))
    assert [each.episode for each in shown] == [0] * LENGTHS[0] + [1] * LENGTHS[1]
    for number, each in enumerate(shown):
        seen = features(number)
        assert each.action == pytest.approx((0.9, 0.01 * number))
        assert each.features.scan == pytest.approx(seen.scan)
        assert np.abs(each.features.image - seen.image).max() < 0.05  # a video loses a little
    assert [each.source for each in shown[:3]] == ["human", "human", "camera"]


def test_only_what_a_person_drove_is_taken_unless_more_is_asked_for(data_set):
    assert [each.source for each in read_lerobot(data_set, PROFILE)] == ["human"] * 2
    assert len(list(read_lerobot(data_set, PROFILE, "buffer"))) == 1  # by the recording's counts


def test_import_makes_labels_that_a_run_begins_with(data_set, tmp_path, capsys):
    assert main(["import", str(data_set), "--run", str(tmp_path), "--frames", "all"]) == 0
    assert "to be learned: 9 labels (human 2, camera 1, novice 6)" in capsys.readouterr().out
    labels = list(read_demonstrations(tmp_path / "labels.lira"))
    assert len(labels) == 9
    assert all(label.stored for label in labels)
    assert labels[8].action == pytest.approx((0.9, 0.08))


def info_with(data_set, tmp_path, **changes):
    """The data set's description with other features."""
    words = json.loads((data_set / "meta/info.json").read_text())
    features = words["features"] | changes.pop("features", {})
    words["features"] = {name: each for name, each in features.items() if each is not None}
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta/info.json").write_text(json.dumps(words | changes))
    return tmp_path


def test_a_data_set_of_another_version_is_told(data_set, tmp_path):
    with pytest.raises(StorageError, match=r"version v2\.1"):
        read_info(info_with(data_set, tmp_path, codebase_version="v2.1"))


@pytest.mark.parametrize(
    ("feature", "words"),
    [
        ({"action": {"dtype": "float32", "shape": [6]}}, "two numbers"),
        ({SCAN: {"dtype": "float32", "shape": [7]}}, "the scan of 'thesis-sim' is"),
        ({CAMERA: None, "images.front": VIDEO, "images.wrist": VIDEO}, "not clear which feature"),
    ],
)
def test_features_that_do_not_fit_are_told(data_set, tmp_path, feature, words):
    with pytest.raises(ConfigError, match=words):
        features_for(read_info(info_with(data_set, tmp_path, features=feature)), PROFILE, {})


def test_a_feature_of_another_name_is_named(data_set, tmp_path):
    info = read_info(info_with(data_set, tmp_path, features={"images.front": VIDEO}))
    assert features_for(info, PROFILE, {}) == {"image": CAMERA, "scan": SCAN}  # the usual one
    assert features_for(info, PROFILE, {"image": "images.front"})["image"] == "images.front"


def test_the_only_camera_of_a_data_set_is_the_robots(data_set, tmp_path):
    info = read_info(info_with(data_set, tmp_path, features={CAMERA: None, "images.front": VIDEO}))
    assert features_for(info, PROFILE, {})["image"] == "images.front"


def test_depth_goes_out_and_comes_back(tmp_path):
    """Of a robot that learns from it."""
    profile = load_profile("thesis-sim-depth")
    columns = np.linspace(500, 4000, 40, dtype=np.uint16)
    depths = [DepthImage(stamp(number), np.tile(columns + 100 * number, (30, 1))) for number in range(sum(LENGTHS))]
    kept = [compress_depth(each) for each in depths]
    heard = [Message(DEPTH.key, each) for each in kept] + list(recording())
    tables = tables_of(list(episodes_of(steps_of(heard))), profile)
    assert tables[0]["complete"].values.all()
    seen = {**cameras(), "depth": depth_pictures(lambda: iter(kept), profile)}
    write_lerobot(tables, seen, tmp_path / "set", robot=profile.name, task="t", fps=5)
    shape = profile.features
    for shown, depth in zip(read_lerobot(tmp_path / "set", profile, "all"), depths, strict=True):
        near = near_depth(depth, shape.image_px, shape.max_depth_m or shape.max_range_m)
        assert np.abs(shown.features.depth - near).max() < 0.05
    write_robomimic(tables, seen, tmp_path / "run.hdf5", {})
    with h5py.File(tmp_path / "run.hdf5") as file:
        assert file["data/demo_1/obs/depth"].shape == (LENGTHS[1], shape.image_px, shape.image_px, 3)


def test_a_data_set_that_was_damaged_is_told(data_set, tmp_path):
    folder = info_with(data_set, tmp_path)
    (folder / "meta/episodes/chunk-000").mkdir(parents=True)
    (folder / "meta/episodes/chunk-000/file-000.parquet").write_bytes(b"PAR1 nothing")
    with pytest.raises(StorageError, match="cannot be read"):
        list(read_lerobot(folder, PROFILE))


def test_pictures_among_the_numbers_are_as_good_as_a_video(data_set, tmp_path):
    folder = info_with(data_set, tmp_path, features={CAMERA: {"dtype": "image", "shape": [48, 64, 3]}})
    rows = pq.read_table(data_set / "data/chunk-000/file-000.parquet")
    kept = [{"bytes": bytes(picture(number).data), "path": ""} for number in range(len(rows))]
    for part, table in (("data", rows.append_column(CAMERA, [kept])), ("meta/episodes", None)):
        target = folder / part / "chunk-000/file-000.parquet"
        target.parent.mkdir(parents=True)
        pq.write_table(
            pq.read_table(data_set / part / "chunk-000/file-000.parquet") if table is None else table, target
        )
    (shown, *_) = read_lerobot(folder, PROFILE, "all")
    assert (shown.features.image == features(0).image).all()


def test_what_a_robot_cannot_do_is_cut_and_counted(tmp_path):
    shown = [Shown(1.0, 0, features(0), (2.0, 0.1)), Shown(2.0, 0, features(1), (0.5, 0.1))]
    tally = keep(shown, tmp_path / "labels.lira", PROFILE)
    assert (tally.taken, tally.clipped) == ({"human": 2}, 1)
    assert [label.action for label in read_demonstrations(tmp_path / "labels.lira")] == [(1.0, 0.1), (0.5, 0.1)]
    with pytest.raises(StorageError, match="nothing to learn from"):
        keep([], tmp_path / "others.lira", PROFILE)
    assert not (tmp_path / "others.lira").exists()


def test_what_cannot_be_a_label_is_told_or_left_out(tmp_path):
    nothing = Shown(1.0, 0, features(0), (float("nan"), 0.1))
    others = [Shown(2.0, 0, features(1), (0.5, 0.1), name) for name in ("lab/wall:go", "o" * 99, " ", "a\n")]
    tally = keep([nothing, *others], tmp_path / "labels.lira", PROFILE)
    assert (tally.taken.total(), tally.without) == (4, 1)
    names = [label.source for label in read_demonstrations(tmp_path / "labels.lira")]
    assert names == ["lab/wall:go", "human", "human", "human"]
    metres = Features(image=features(0).image, scan=features(0).scan * 4)
    with pytest.raises(StorageError, match="not within 0 and 1"):
        keep([Shown(1.0, 0, metres, (0.5, 0.1))], tmp_path / "labels.lira", PROFILE)


@pytest.mark.parametrize("path", ["data/{nothing}.parquet", "data/{chunk_index:x", "../nothing.parquet"])
def test_a_description_that_makes_no_sense_is_told(data_set, tmp_path, path):
    folder = info_with(data_set, tmp_path, data_path=path)
    (folder / "meta/episodes").symlink_to(data_set / "meta/episodes")
    with pytest.raises(StorageError, match="cannot be read"):
        list(read_lerobot(folder, PROFILE))


# Bags, written by rosbags.


def bag(folder, messages, plugin=StoragePlugin.MCAP):
    """Write (time, topic, message) as others do."""
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        connections = {}
        for time_s, topic, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, ros_type_of(type(message)), typestore=TYPES)
            writer.write(connections[topic], round(time_s * 1e9), encode(message))
    return folder


def drive(command=lambda number: Twist(BASE.max_linear_m_s / 2, 0.1 * number), count=5):
    """A person drives: sensors at each step, commands at four times the rate."""
    for number in range(count):
        yield stamp(number), "/scan", replace(scan(number), stamp_s=7.0)  # the stamp is of another clock
        yield stamp(number), "/camera", replace(picture(number), stamp_s=9.0)
        for part in range(4):
            yield stamp(number) + (0.001 + part * PERIOD_S / 4), "/cmd_vel", command(number)


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_a_bag_is_taken_at_the_rate_of_control(tmp_path, plugin):
    shown = list(read_bag(bag(tmp_path / "bag", drive(), plugin), PROFILE, {}))
    assert len(shown) == 5
    for number, each in enumerate(shown):
        seen = features(number)
        assert each.action == pytest.approx((0.5, 0.1 * number / BASE.max_angular_rad_s))
        assert (each.features.scan == seen.scan).all()
        assert (each.features.image == seen.image).all()


@pytest.mark.parametrize(
    ("command", "count"),
    [
        (lambda number: TwistStamped(stamp(number), Twist(0.1, 0.0)), 5),
        (lambda _: Applied(Twist(0.1, 0.0), 1.0, Source.TELEOP, Reason.OK, (), 0, 0.0), 5),
        (lambda _: Applied(Twist(0.1, 0.0), 1.0, Source.POLICY, Reason.OK, (), 0, 0.0), 0),
        (lambda number: Twist(0.1 if number > 1 else 0.0, 0.0), 3),
    ],
    ids=["stamped", "by hand", "by a policy", "at rest"],
)
def test_only_what_a_hand_commands_is_taken(tmp_path, command, count):
    assert len(list(read_bag(bag(tmp_path / "bag", drive(command)), PROFILE, {}))) == count


def test_a_silent_sensor_and_a_pause_are_seen(tmp_path):
    messages = list(drive(count=10))
    silent = [each for each in messages if each[1] != "/camera" or each[0] < stamp(3)]
    shown = list(read_bag(bag(tmp_path / "silent", silent), PROFILE, {}))
    assert len(shown) == 4  # the last picture counts for 0.3 s
    paused = [(time_s + (30.0 if time_s >= stamp(5) else 0.0), topic, each) for time_s, topic, each in messages]
    shown = list(read_bag(bag(tmp_path / "paused", paused), PROFILE, {}))
    assert [each.episode for each in shown] == [1] * 5 + [2] * 5


def test_messages_that_cannot_be_read_are_left_out(tmp_path):
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {}
        for number, (time_s, topic, message) in enumerate(drive()):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, ros_type_of(type(message)), typestore=TYPES)
            data = encode(message)
            writer.write(connections[topic], round(time_s * 1e9), data[: len(data) // 2] if number % 7 == 3 else data)
    assert 0 < len(list(read_bag(tmp_path / "bag", PROFILE, {}))) <= 5


def test_a_bag_of_ros_1_is_as_good(tmp_path):
    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer1(tmp_path / "old.bag") as writer:
        connections = {}
        for time_s, topic, message in drive():
            kind = ros_type_of(type(message))
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], round(time_s * 1e9), store.serialize_ros1(ros1(message, store), kind))
    shown = list(read_bag(tmp_path / "old.bag", PROFILE, {}))
    assert len(shown) == 5
    assert (shown[2].features.scan == features(2).scan).all()


def ros1(message, store):
    """The same as ROS 1 has it: every header counts."""
    made = CODECS[type(message)].to_ros(message)
    if not hasattr(made, "header"):
        return made
    values = {name: getattr(made, name) for name in made.__dataclass_fields__ if name != "__msgtype__"}
    head = store.types["std_msgs/msg/Header"](seq=0, stamp=made.header.stamp, frame_id=made.header.frame_id)
    return store.types[made.__msgtype__](**values | {"header": head})


def test_which_topic_is_meant_has_to_be_clear():
    types = {"/a": SCAN_TYPE, "/b": SCAN_TYPE, "/c": PICTURE_TYPE, "/d": TWIST_TYPE, "/e": "std_msgs/msg/Bool"}
    with pytest.raises(ConfigError, match="several for scan") as told:
        choose(types, {})
    assert "--scan: /a, /b" in told.value.remedy
    assert [each.topic for each in choose(types, {"scan": "/b"})] == ["/b", "/c", "/d"]
    with pytest.raises(ConfigError, match="no topic '/e' of the bag is a scan"):
        choose(types, {"scan": "/e"})
    with pytest.raises(ConfigError, match="nobody commands"):
        choose({"/a": SCAN_TYPE}, {})


def test_what_is_no_bag_is_told(tmp_path, capsys):
    (tmp_path / "nothing").mkdir()
    assert main(["import", str(tmp_path / "nothing"), "--run", str(tmp_path / "run")]) == 2
    assert "neither a bag nor" in capsys.readouterr().err


def test_a_bag_becomes_labels(tmp_path, capsys):
    folder = bag(tmp_path / "bag", drive())
    assert main(["import", str(folder), "--run", str(tmp_path / "run")]) == 0
    assert "to be learned: 5 labels (human 5)" in capsys.readouterr().out
    assert len(list(read_demonstrations(tmp_path / "run/labels.lira"))) == 5
