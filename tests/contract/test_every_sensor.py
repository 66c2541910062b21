"""Every sensor of every robot arrives, over every transport, as it was measured."""

from dataclasses import fields

import cv2
import numpy as np
import pytest
from robots import PROFILE, ROBOTS, Rig
from test_robot_contract import step

from lira.hal.bus.sensors import SENSORS, sensors_of
from lira.hal.bus.topics import TOPICS
from lira.hal.messages import STOP, CompressedImage, DepthImage, Image, Observation
from lira.hal.messages.compression import read_depth

STEPS = 30  # 6 s: a battery says something once a second


@pytest.fixture(params=ROBOTS)
def rig(request):
    with ROBOTS[request.param]() as rig:
        yield rig


def alike(sent, got) -> bool:
    """Whether this is what was sent, but for what rounding and a lossless picture do to it."""
    if isinstance(got, CompressedImage) and isinstance(sent, DepthImage):
        return np.array_equal(read_depth(got).data, sent.data)
    if isinstance(got, CompressedImage) and isinstance(sent, Image):
        return np.array_equal(cv2.imdecode(np.frombuffer(got.data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1], sent.data)
    if type(got) is not type(sent):
        return False
    names = [field.name for field in fields(sent) if field.name != "stamp_s"]
    return all(equal(getattr(sent, name), getattr(got, name)) for name in names)


def equal(one, other) -> bool:
    if isinstance(one, np.ndarray):
        return np.allclose(one, other, atol=1e-6, equal_nan=True)
    return other == (pytest.approx(one, abs=1e-6, nan_ok=True) if isinstance(one, float) else one)


def drive_until_complete(rig: Rig) -> tuple[Observation, dict[str, list]]:
    """Let it measure until the driver has something of each sensor; returns that, and what was measured, by sensor."""
    measured: dict[str, list] = {sensor.name: [] for sensor in SENSORS}
    read = rig.source.read

    def noted() -> Observation:
        seen = read()
        for sensor in SENSORS:
            value, before = sensor.value(seen), measured[sensor.name]
            if value is not None and not (before and before[-1] is value):
                before.append(value)
        return seen

    rig.source.read = noted
    wanted = sensors_of(rig.robot.profile)
    for _ in range(STEPS):
        step(rig, STOP)
        seen = rig.robot.read()
        if all(sent_as(sensor.value(seen), measured[sensor.name], rig) for sensor in wanted):
            break
    return seen, measured


def sent_as(got, measured: list, rig: Rig) -> list:
    """What was measured at the time of what arrived."""
    return [each for each in measured if got and abs(each.stamp_s + rig.ahead_s - got.stamp_s) < rig.stamps_s]


def test_every_sensor_of_the_robot_arrives_as_it_was_measured(rig):
    seen, measured = drive_until_complete(rig)
    for sensor in sensors_of(rig.robot.profile):
        got = sensor.value(seen)
        assert got is not None, f"{sensor.name} never arrives"
        sent = sent_as(got, measured[sensor.name], rig)
        assert any(alike(each, got) for each in sent), f"{sensor.name}: {got}"
    has = {sensor.name for sensor in SENSORS if sensor.value(seen) is not None}
    assert has == {sensor.name for sensor in sensors_of(rig.robot.profile)}


def test_the_profile_of_the_contract_has_every_sensor():
    assert sensors_of(PROFILE) == SENSORS


def test_every_field_of_an_observation_has_a_row_and_every_row_a_topic():
    assert {sensor.field for sensor in SENSORS} == {field.name for field in fields(Observation)} - {"seq", "stamp_s"}
    assert all(sensor.topic in TOPICS for sensor in SENSORS)
    assert len({sensor.name for sensor in SENSORS}) == len(SENSORS)
