"""What Rerun is told, read back from its file by its own reader; and how a recording is told to viewers."""

import math
from itertools import chain

import numpy as np
import pyarrow as pa
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from lira.hal.bus.topics import (
    APPLIED,
    BATTERY,
    CAMERA,
    CAMERA_INFO,
    DECISION,
    DESCRIPTION,
    DIAGNOSTICS,
    ODOM,
    SCAN,
    SESSION,
    TF,
    TF_STATIC,
)
from lira.hal.description.camera_info import pinhole
from lira.hal.description.frames import odometry_transform, static_transforms
from lira.hal.description.urdf import urdf_of
from lira.hal.errors import StorageError
from lira.hal.messages import (
    Applied,
    BatteryState,
    Call,
    CompressedImage,
    Decision,
    DiagnosticArray,
    DiagnosticStatus,
    ExpertView,
    LabelCounts,
    LaserScan,
    Odometry,
    Reason,
    SessionState,
    Source,
    Stage,
    Text,
    Twist,
)
from lira.hal.profile import load_profile
from lira.tools.view.rerun_entities import ENTITIES
from lira.tools.view.rerun_viewer import RerunViewer
from lira.tools.view.source import PlayedSource, Sample

PROFILE = load_profile("rosbot2")
NOW_NS = 1_700_000_000_000_000_000
ODOMETRY = Odometry(1.0, 1.0, 2.0, 0.5, 0.19, 0.1)
EXPERTS = (ExpertView("camera", (1.0, 0.2), 0.4, True), ExpertView("lab/wall", (1.0, 0.0), 0.01, False))
PNG = b"\x89PNG\r\n\x1a\n..."
EVERYTHING = (
    (DESCRIPTION, Text(urdf_of(PROFILE))),
    (TF_STATIC, static_transforms(PROFILE, 1.0)),
    (TF, odometry_transform(ODOMETRY)),
    (CAMERA_INFO, pinhole(PROFILE.camera, 640, 480, 1.0)),
    (CAMERA, CompressedImage(1.0, PNG, "png")),
    (SCAN, LaserScan(1.0, 0.0, math.pi / 2, 0.1, 4.0, np.array([1.0, np.inf, 2.0, np.nan], np.float32))),
    (ODOM, ODOMETRY),
    (APPLIED, Applied(Twist(0.2, 0.1), 1.0, Source.POLICY, Reason.OK, (), 7, 0.05)),
    (
        DECISION,
        Decision(
            1.0, 7, "camera", Call.ATTENTION, (1.0, 0.2), (1.0, 0.1), None, EXPERTS, 0.06, LabelCounts(), 13, 2, 3
        ),
    ),
    (SESSION, SessionState(1.0, Stage.PROVING, alone=0.8)),
    (BATTERY, BatteryState(1.0, 11.5)),
    (DIAGNOSTICS, DiagnosticArray(1.0, (DiagnosticStatus(2, "lidar", "lost"), DiagnosticStatus(0, "base", "")))),
)


def sample(topic, message, number=0):
    return Sample(topic, message, b"", NOW_NS + number * 1_000_000)


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """Columns of each entity of a file, by path and component: all values, flat."""
    path = tmp_path_factory.mktemp("rerun") / "run.rrd"
    viewer = RerunViewer("rosbot", path)
    viewer.show([sample(topic, message) for topic, message in EVERYTHING if topic.key in viewer.wanted()])
    viewer.close()
    found: dict[str, dict[str, list]] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        values = found.setdefault(chunk.entity_path, {})
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            plain = column.cast("int64") if pa.types.is_timestamp(column.type) else column
            values.setdefault(name, []).extend(plain.to_pylist())
    return found


def value(told, path, component):
    (found,) = told[path][component]
    return found[0] if isinstance(found, list) and len(found) == 1 else found


def test_the_model_and_its_frames_are_there(told):
    assert "/robot/rosbot2/visual_geometries/base_link/visual_0" in told
    fixed = [each for path in told for each in told[path].get("Transform3D:child_frame", [])]
    assert {"laser", "camera_optical_frame", "base_link"} <= {each[0] for each in fixed}
    assert value(told, "/robot/frames/base_link", "Transform3D:parent_frame") == "odom"
    assert value(told, "/robot/frames/base_link", "Transform3D:translation") == [1.0, 2.0, 0.0]


def test_the_scan_has_its_returns_in_the_lidars_frame(told):
    points = np.array(value(told, "/world/scan", "Points3D:positions"))
    assert points == pytest.approx(np.array([[1.0, 0.0, 0.0], [-2.0, 0.0, 0.0]]), abs=1e-6)
    assert value(told, "/world/scan", "CoordinateFrame:frame") == "laser"


def test_the_picture_is_seen_from_the_camera(told):
    assert bytes(value(told, "/world/camera", "EncodedImage:blob")) == PNG
    assert value(told, "/world/camera", "EncodedImage:media_type") == "image/png"
    assert value(told, "/world/camera", "Pinhole:parent_frame") == "camera_optical_frame"
    assert value(told, "/world/camera", "Pinhole:resolution") == [640.0, 480.0]


def test_who_drives_and_why_are_states(told):
    states = {path: value(told, path, "StateChange:state") for path in told if path.startswith("/who/")}
    assert states == {
        "/who/drives": "camera",
        "/who/call": "attention",
        "/who/commands": "policy",
        "/who/reason": "ok",
        "/who/stage": "proving",
    }


def test_actions_and_activations_are_numbers_over_time(told):
    numbers = {path: value(told, path, "Scalars:scalars") for path in told if "Scalars:scalars" in told[path]}
    assert numbers["/action/angular/executed"] == 0.2
    assert numbers["/action/angular/novice"] == 0.1
    assert numbers["/action/angular/experts/camera"] == 0.2
    assert numbers["/activation/experts/camera"] == 0.4
    assert numbers[r"/activation/experts/lab\/wall"] == 0.01
    assert numbers["/activation/threshold"] == 0.06
    assert "/action/angular/human" not in numbers
    assert numbers["/learning/training_steps"] == 13
    assert numbers["/battery"] == 11.5


def test_what_is_wrong_is_told_and_what_is_well_is_not(told):
    assert [each[0] for each in told["/diagnostics"]["TextLog:text"]] == ["lidar: lost"]


def test_the_file_goes_by_the_time_at_which_it_was_heard(told):
    assert told["/battery"]["heard"] == [NOW_NS]


def test_a_picture_of_another_kind_is_left_out():
    assert list(ENTITIES[CAMERA.key](CompressedImage(1.0, b"RIFF", "webp"))) == []
    ((_, picture),) = ENTITIES[CAMERA.key](CompressedImage(1.0, b"\xff\xd8\xff\xe0"))
    assert isinstance(picture, rr.EncodedImage)


def test_no_file_is_written_over(tmp_path):
    (tmp_path / "run.rrd").write_text("mine")
    with pytest.raises(StorageError, match="cannot write"):
        RerunViewer("rosbot", tmp_path / "run.rrd")
    assert (tmp_path / "run.rrd").read_text() == "mine"


# A recording, told.


def recorded(count):
    yield sample(TF_STATIC, "fixed")
    for number in range(count):
        yield sample(ODOM, number, number)
        yield sample(SCAN, number, number)


def messages(samples, topic=ODOM):
    return [each.message for each in samples if each.topic == topic]


def test_nothing_is_told_before_somebody_looks():
    source = PlayedSource(recorded(3), speed=0.0)
    assert source.poll() == []
    source.listen({ODOM.key})
    assert messages(source.poll()) == [0, 1, 2]
    assert source.ended


def test_only_what_is_looked_at_is_told():
    source = PlayedSource(recorded(3), speed=0.0)
    source.listen({ODOM.key})
    assert messages(source.poll(), SCAN) == []


def test_who_looks_late_is_told_what_was_latched():
    source = PlayedSource(recorded(3), speed=0.0)
    source.listen({ODOM.key})
    source.poll()
    source.listen({ODOM.key, TF_STATIC.key})
    assert not source.ended
    assert messages(source.poll(), TF_STATIC) == ["fixed"]


def test_a_long_recording_is_told_in_parts():
    source = PlayedSource(recorded(2000), speed=0.0)
    source.listen({ODOM.key})
    assert messages(source.poll()) == list(range(PlayedSource.AT_ONCE))
    parts = [messages(source.poll()) for _ in range(4)]
    assert list(chain(*parts)) == list(range(PlayedSource.AT_ONCE, 2000))


def test_it_is_told_at_its_own_pace(monkeypatch):
    now_ns = [5_000]
    monkeypatch.setattr("lira.tools.view.source.time.monotonic_ns", lambda: now_ns[0])
    source = PlayedSource(recorded(100), speed=2.0)
    source.listen({ODOM.key})
    assert messages(source.poll()) == [0]
    now_ns[0] += 5_000_000  # 5 ms, in which 10 ms of it are told
    assert messages(source.poll()) == list(range(1, 11))
    assert not source.ended
