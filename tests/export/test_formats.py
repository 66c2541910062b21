"""What others read: LeRobot's folder by pyarrow and PyAV, and by LeRobot itself where it is installed; HDF5; CSV."""

import csv
import json
import math

import av
import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
from heard import DRIVERS, HEIGHT, LENGTHS, PROFILE, WIDTH, cameras, level, recording

from lira.hal.errors import StorageError
from lira.tools.export.columns import tables_of
from lira.tools.export.csv_file import write_csv
from lira.tools.export.lerobot import PICTURES, write_lerobot
from lira.tools.export.robomimic import write_robomimic
from lira.tools.export.statistics import merged, statistics_of
from lira.tools.export.steps import episodes_of, steps_of

COUNT, FPS = sum(LENGTHS), 5
CAMERA = f"{PICTURES}camera"


def tables(messages=None):
    return tables_of(list(episodes_of(steps_of(recording() if messages is None else messages))), PROFILE)


@pytest.fixture(scope="module")
def lerobot(tmp_path_factory):
    """A folder as LeRobot has it."""
    folder = tmp_path_factory.mktemp("lerobot") / "run"
    write_lerobot(tables(), cameras(), folder, robot="thesis-sim", task="follow the line", fps=FPS)
    return folder


def info_of(folder):
    return json.loads((folder / "meta/info.json").read_text())


def test_info_counts_and_names_what_there_is(lerobot):
    info = info_of(lerobot)
    assert (info["codebase_version"], info["fps"], info["robot_type"]) == ("v3.0", FPS, "thesis-sim")
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (2, COUNT, 1)
    assert info["splits"] == {"train": "0:2"}
    features = info["features"]
    assert features["action"] == {"dtype": "float32", "shape": [2], "names": ["linear", "angular"]}
    assert features["intervention"]["dtype"] == features["in_buffer"]["dtype"] == "bool"
    assert features["source"]["dtype"] == "string"
    assert features["policy_version"]["dtype"] == features["episode_index"]["dtype"] == "int64"
    assert features[CAMERA]["shape"] == [HEIGHT, WIDTH, 3]
    assert not [name for name in features if "/" in name]


def test_every_file_is_where_info_says(lerobot):
    info, where = info_of(lerobot), {"chunk_index": 0, "file_index": 0}
    assert (lerobot / info["data_path"].format(**where)).is_file()
    assert (lerobot / info["video_path"].format(video_key=CAMERA, **where)).is_file()


def test_rows_hold_every_feature_but_pictures(lerobot):
    rows = pq.read_table(lerobot / "data/chunk-000/file-000.parquet")
    info = info_of(lerobot)
    assert set(rows.column_names) == set(info["features"]) - {CAMERA}
    assert rows["source"].to_pylist()[: len(DRIVERS)] == list(DRIVERS)
    assert rows["index"].to_pylist() == list(range(COUNT))
    assert rows["episode_index"].to_pylist() == [0] * 5 + [1] * 4
    assert rows["frame_index"].to_pylist() == [*range(5), *range(4)]
    assert rows["timestamp"].to_pylist() == pytest.approx([n / FPS for n in (*range(5), *range(4))])
    assert np.array(rows["action"].to_pylist())[:, 1] == pytest.approx(0.01 * np.arange(COUNT))
    for name, feature in info["features"].items():
        if name != CAMERA:
            width = getattr(rows.schema.field(name).type, "list_size", 1)
            assert [width] == feature["shape"], name


def test_episodes_say_where_they_are(lerobot):
    episodes = pq.read_table(lerobot / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [each["length"] for each in episodes] == list(LENGTHS)
    assert [(each["dataset_from_index"], each["dataset_to_index"]) for each in episodes] == [(0, 5), (5, 9)]
    assert [each[f"videos/{CAMERA}/from_timestamp"] for each in episodes] == pytest.approx([0.0, 5 / FPS])
    assert [each["tasks"] for each in episodes] == [["follow the line"]] * 2
    assert episodes[0]["stats/action/max"] == pytest.approx([0.9, 0.04])
    assert np.shape(episodes[0][f"stats/{CAMERA}/mean"]) == (3, 1, 1)


def test_the_video_shows_each_step_at_its_time(lerobot):
    with av.open(str(lerobot / f"videos/{CAMERA}/chunk-000/file-000.mp4")) as file:
        assert file.streams.video[0].codec_context.name == "h264"
        frames = [(frame.time, frame.to_ndarray(format="rgb24")) for frame in file.decode(video=0)]
    assert [time for time, _ in frames] == pytest.approx([n / FPS for n in range(COUNT)])
    for number, (_, frame) in enumerate(frames):
        assert abs(int(frame[HEIGHT // 2, WIDTH // 2, 0]) - level(number)) <= 4
        assert frame[HEIGHT // 2, 4, 0] > 150 > 60 > frame[HEIGHT // 2, 4, 2]  # the red edge


def test_statistics_are_those_of_all_rows(lerobot):
    stats = json.loads((lerobot / "meta/stats.json").read_text())
    assert stats["action"]["count"] == [COUNT]
    assert stats["action"]["mean"] == pytest.approx([0.9, 0.04])
    assert stats["action"]["std"] == pytest.approx([0.0, 0.01 * np.arange(COUNT).std()], abs=1e-6)
    assert stats["intervention"]["mean"] == pytest.approx([2 / COUNT])
    assert set(stats["action"]) == {"min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99"}
    assert "source" not in stats
    middle = np.mean([level(n) for n in range(COUNT)]) / 255
    assert stats[CAMERA]["mean"][1][0][0] == pytest.approx(middle * 0.75, abs=0.01)  # a quarter is red


def test_what_is_not_known_counts_for_nothing():
    found = statistics_of(np.array([[1.0, math.nan], [3.0, math.nan]]))
    assert found["mean"] == [2.0, 0.0]
    assert merged([found, statistics_of(np.array([[7.0, 0.0]] * 2))])["mean"] == [4.5, 0.0]


def test_pandas_finds_the_tasks_by_their_words(lerobot):
    table = pq.read_table(lerobot / "meta/tasks.parquet")
    words = json.loads(table.schema.metadata[b"pandas"])
    assert words["index_columns"] == ["task"]
    assert table.to_pylist() == [{"task_index": 0, "task": "follow the line"}]


def test_lerobot_reads_it_itself(lerobot):
    datasets = pytest.importorskip("lerobot.datasets.lerobot_dataset", reason="no client of others is installed")
    dataset = datasets.LeRobotDataset("lira/run", root=lerobot, video_backend="pyav")
    assert (len(dataset), dataset.num_episodes, dataset.fps) == (COUNT, 2, FPS)
    for number in (0, 4, 5, COUNT - 1):
        item = dataset[number]
        assert item["action"].tolist() == pytest.approx([0.9, 0.01 * number])
        assert item["task"] == "follow the line"
        assert item[CAMERA].shape == (3, HEIGHT, WIDTH)
        assert float(item[CAMERA][0, HEIGHT // 2, WIDTH // 2]) == pytest.approx(level(number) / 255, abs=0.02)
    assert dataset[0]["source"] == "human"
    assert bool(dataset[0]["intervention"])
    assert dataset.meta.stats["action"]["mean"].tolist() == pytest.approx([0.9, 0.04])


def test_a_run_without_a_camera_has_no_video(tmp_path):
    messages = [each for each in recording() if "camera" not in each.key]
    write_lerobot(tables(messages), cameras(messages), tmp_path / "run", robot="r", task="t", fps=FPS)
    assert info_of(tmp_path / "run")["video_path"] is None
    assert not (tmp_path / "run/videos").exists()


def test_robomimic_has_a_group_for_each_episode(tmp_path):
    write_robomimic(tables(), cameras(), tmp_path / "run.hdf5", {"robot": "thesis-sim", "world": "line"})
    with h5py.File(tmp_path / "run.hdf5") as file:
        assert file["data"].attrs["total"] == COUNT
        assert json.loads(file["data"].attrs["env_args"])["env_name"] == "line"
        demo = file["data/demo_0"]
        assert demo.attrs["num_samples"] == 5
        assert demo["actions"][:, 1] == pytest.approx(0.01 * np.arange(5))
        assert demo["dones"][:].tolist() == [0, 0, 0, 0, 1]
        assert demo["obs/image"].shape == (5, HEIGHT, WIDTH, 3)
        assert demo["obs/image"][3, 20, 40, 0] == level(3)
        assert demo["obs/scan"].shape == (5, PROFILE.features.bins)
        assert demo["next_obs/image"][:, 20, 40, 0].tolist() == [level(n) for n in (1, 2, 3, 4, 4)]
        assert (demo["next_obs/scan"][:-1] == demo["obs/scan"][1:]).all()
        assert demo["intervention"][:].tolist() == [True, True, False, False, False]
        assert [word.decode() for word in demo["source"][:]] == list(DRIVERS)
        assert [name.decode() for name in file["mask/train"][:]] == ["demo_0"]
        assert [name.decode() for name in file["mask/prove"][:]] == ["demo_1"]


def test_a_lap_of_one_step_is_a_lap(tmp_path):
    messages = list(recording())[:7]  # up to the first decision and what came of it
    write_robomimic(tables(messages), cameras(messages), tmp_path / "run.hdf5", {})
    with h5py.File(tmp_path / "run.hdf5") as file:
        assert file["data/demo_0/next_obs/image"].shape == (1, HEIGHT, WIDTH, 3)
        assert (file["data/demo_0/next_obs/scan"][:] == file["data/demo_0/obs/scan"][:]).all()
    write_lerobot(tables(messages), cameras(messages), tmp_path / "run", robot="r", task="t", fps=FPS)
    assert info_of(tmp_path / "run")["total_frames"] == 1


def test_robomimic_reads_it_itself(tmp_path):
    sets = pytest.importorskip("robomimic.utils.dataset", reason="no client of others is installed")
    from robomimic.utils.obs_utils import initialize_obs_utils_with_obs_specs

    write_robomimic(tables(), cameras(), tmp_path / "run.hdf5", {"world": "line"})
    initialize_obs_utils_with_obs_specs({"obs": {"low_dim": ["state", "scan"], "rgb": ["image"]}})
    keys = {"obs_keys": ("state", "scan", "image"), "dataset_keys": ("actions", "intervention")}
    data = sets.SequenceDataset(
        str(tmp_path / "run.hdf5"),
        **keys,
        frame_stack=1,
        seq_length=2,
        filter_by_attribute="train",
        hdf5_cache_mode=None,
    )
    assert len(data) == LENGTHS[0]
    item = data[1]
    assert item["actions"][:, 1] == pytest.approx([0.01, 0.02])
    assert item["intervention"].tolist() == [True, False]
    assert item["obs"]["image"][0, 20, 40, 0] == level(1)
    assert item["next_obs"]["image"][0, 20, 40, 0] == level(2)


def test_csv_has_a_line_for_each_step(tmp_path):
    write_csv(tables(), tmp_path / "run.csv")
    with (tmp_path / "run.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == COUNT
    assert [row["source"] for row in rows[:5]] == list(DRIVERS)
    assert [row["intervention"] for row in rows[:5]] == ["1", "1", "0", "0", "0"]
    assert float(rows[4]["experts.camera.action.angular"]) == pytest.approx(0.4)
    assert (rows[5]["episode"], rows[5]["step"], rows[5]["lap"]) == ("1", "0", "2")
    assert len(rows[0]) < 40


@pytest.mark.parametrize("write", [write_csv, lambda t, p: write_robomimic(t, cameras(), p, {})])
def test_nothing_is_written_over(tmp_path, write):
    (tmp_path / "there").write_text("mine")
    with pytest.raises(StorageError, match="cannot write"):
        write(tables(), tmp_path / "there")
    assert (tmp_path / "there").read_text() == "mine"


def test_no_data_set_is_written_over(lerobot):
    with pytest.raises(StorageError, match="cannot write"):
        write_lerobot(tables(), cameras(), lerobot, robot="r", task="t", fps=FPS)
