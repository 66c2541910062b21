"""What a client takes for fresh."""

from types import SimpleNamespace

import msgspec
import pytest

from lira.hal.bus.reader import Received
from lira.hal.bus.sensors import SENSORS
from lira.hal.bus.topics import ODOM
from lira.hal.client.sensor_reader import Sense, SensorReader
from lira.hal.messages import Odometry
from lira.hal.profile import Depth, load_profile


@pytest.mark.parametrize(("ahead_s", "until_s"), [(-0.1, 0.2), (0.0, 0.3), (0.09, 0.39), (0.15, None), (0.3, None)])
def test_a_value_from_the_future_is_not_fresh_for_longer_nor_later(ahead_s, until_s):
    odom = Odometry(100.0 + ahead_s, 0.0, 0.0, 0.0, 0.0, 0.0)
    received = Received(odom, None, 0.0)
    sense = Sense(SimpleNamespace(reader=lambda _: SimpleNamespace(newest=lambda: received)), ODOM)
    fresh = [step / 100 for step in range(100) if sense.read(100.0 + step / 100) is odom]
    assert fresh == ([] if until_s is None else [step / 100 for step in range(round(until_s * 100) + 1)])


def test_a_client_listens_to_depth_only_if_the_robot_has_it_and_to_all_that_is_small():
    for depth in (None, Depth(width_px=16, height_px=12, range_min_m=0.1, range_max_m=4.0)):
        asked = []
        bus = SimpleNamespace(reader=asked.append)
        SensorReader(bus, msgspec.structs.replace(load_profile("thesis-sim"), depth=depth))
        missing = [sensor.name for sensor in SENSORS if sensor.topic not in asked]
        assert missing == (["depth"] if depth is None else [])
