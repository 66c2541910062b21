"""What Rerun is told of each message: where in its tree of entities, and as which of its archetypes. Pure.

`robot/` and `world/` are in space, by the frames of the robot; `camera` is its picture; `who/` are states (who drives,
why, how the person is called); all else are numbers over time.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import rerun as rr

from lira.hal.bus.topics import (
    APPLIED,
    BATTERY,
    CAMERA,
    CAMERA_INFO,
    DECISION,
    DIAGNOSTICS,
    ODOM,
    SCAN,
    SESSION,
    TF,
)
from lira.hal.messages import (
    Action,
    Applied,
    BatteryState,
    CameraInfo,
    CompressedImage,
    Decision,
    DiagnosticArray,
    LaserScan,
    Odometry,
    SessionState,
    Transforms,
)
from lira.hal.messages.description import LASER, OPTICAL
from lira.hal.messages.ranges import read_ranges

PLANE_M = 0.3  # how far ahead of the camera its picture is drawn
Told = tuple[str, Any]  # an entity's path, and an archetype
MEDIA = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}


def _scan(scan: LaserScan) -> Iterator[Told]:
    ranges = read_ranges(scan)
    there = np.isfinite(ranges)
    angles = (scan.angle_min + scan.angle_increment * np.arange(len(ranges)))[there]
    points = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1) * ranges[there][:, None]
    yield "world/scan", rr.CoordinateFrame(LASER)
    yield "world/scan", rr.Points3D(points, radii=0.01, colors=(240, 160, 40))


def _picture(picture: CompressedImage) -> Iterator[Told]:
    media = next((each for start, each in MEDIA.items() if picture.data.startswith(start)), None)
    if media is not None:
        yield "world/camera", rr.EncodedImage(contents=picture.data, media_type=media)


def _camera(info: CameraInfo) -> Iterator[Told]:
    """Its picture stands in space where it was seen from."""
    yield (
        "world/camera",
        rr.Pinhole(
            image_from_camera=np.reshape(info.k, (3, 3)),
            width=info.width,
            height=info.height,
            parent_frame=OPTICAL,
            image_plane_distance=PLANE_M,
        ),
    )


def _transforms(transforms: Transforms) -> Iterator[Told]:
    for each in transforms.transforms:
        yield (
            f"robot/frames/{each.child}",
            rr.Transform3D(
                translation=each.translation,
                quaternion=rr.Quaternion(xyzw=each.rotation),
                parent_frame=each.parent,
                child_frame=each.child,
            ),
        )


def _odometry(odom: Odometry) -> Iterator[Told]:
    yield "speed/odometry", rr.Scalars(odom.linear_m_s)
    yield "turn_rate/odometry", rr.Scalars(odom.angular_rad_s)


def _applied(applied: Applied) -> Iterator[Told]:
    yield "speed/applied", rr.Scalars(applied.twist.linear_m_s)
    yield "turn_rate/applied", rr.Scalars(applied.twist.angular_rad_s)
    yield "command_age", rr.Scalars(applied.command_age_s)
    yield "who/commands", rr.StateChange(state=applied.source.value)
    yield "who/reason", rr.StateChange(state=applied.reason.value)


def _decision(decision: Decision) -> Iterator[Told]:
    yield "who/drives", rr.StateChange(state=decision.driver)
    yield "who/call", rr.StateChange(state=decision.call.value)
    yield "activation/threshold", rr.Scalars(decision.threshold)
    yield from _action("executed", decision.executed)
    yield from _action("novice", decision.novice)
    if decision.human is not None:
        yield from _action("human", decision.human)
    for expert in decision.experts:
        name = rr.escape_entity_path_part(expert.name)
        yield from _action(f"experts/{name}", expert.action)
        yield f"activation/experts/{name}", rr.Scalars(expert.activation)
    counts = {
        "labels_human": decision.labels.stored_human,
        "labels_expert": decision.labels.stored_expert,
        "training_steps": decision.training_steps,
        "interventions": decision.interventions,
        "calls": decision.calls,
    }
    for name, count in counts.items():
        yield f"learning/{name}", rr.Scalars(count)


def _action(name: str, action: Action) -> Iterator[Told]:
    yield f"action/linear/{name}", rr.Scalars(action[0])
    yield f"action/angular/{name}", rr.Scalars(action[1])


def _session(session: SessionState) -> Iterator[Told]:
    yield "who/stage", rr.StateChange(state=session.stage.value)
    yield "learning/alone", rr.Scalars(session.alone)


def _battery(battery: BatteryState) -> Iterator[Told]:
    yield "battery", rr.Scalars(battery.voltage_v)


def _diagnostics(report: DiagnosticArray) -> Iterator[Told]:
    for status in report.status:
        if status.level:
            level = rr.TextLogLevel.WARN if status.level == 1 else rr.TextLogLevel.ERROR
            yield "diagnostics", rr.TextLog(f"{status.name}: {status.message}", level=level)


ENTITIES: dict[str, Callable[[Any], Iterator[Told]]] = {
    SCAN.key: _scan,
    CAMERA.key: _picture,
    CAMERA_INFO.key: _camera,
    TF.key: _transforms,
    ODOM.key: _odometry,
    APPLIED.key: _applied,
    DECISION.key: _decision,
    SESSION.key: _session,
    BATTERY.key: _battery,
    DIAGNOSTICS.key: _diagnostics,
}
