"""What sensors see: scans, images, ranges, the battery."""

import math
from typing import Any

import numpy as np

from lira.hal.messages import BatteryState, CompressedImage, Image, LaserScan, Range
from lira.hal.messages.description import BASE, LASER, OPTICAL
from lira.hal.messages.images import objection, picture_format, transport_format
from lira.hal.messages.ros.types import Codec, header, ros, stamp

CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "mono8": 1}

_NOTHING = np.empty(0, np.float32)


def _scan_to(m: LaserScan) -> Any:
    return ros("sensor_msgs/msg/LaserScan")(
        header(m.stamp_s, LASER),
        m.angle_min,
        m.angle_min + m.angle_increment * max(len(m.ranges) - 1, 0),
        m.angle_increment,
        m.time_increment,
        m.scan_time,
        m.range_min,
        m.range_max,
        np.ascontiguousarray(m.ranges, np.float32),
        _NOTHING,
    )


def _scan_from(message: Any) -> LaserScan:
    return LaserScan(
        stamp(message),
        message.angle_min,
        message.angle_increment,
        message.range_min,
        message.range_max,
        np.array(message.ranges, np.float32),  # a copy: aligned, and free of the payload
        message.scan_time,
        message.time_increment,
    )


def _image_to(m: Image) -> Any:
    height, width = m.data.shape[:2]
    data = np.ascontiguousarray(m.data, np.uint8).reshape(-1)
    if data.size != height * width * CHANNELS[m.encoding]:
        raise ValueError(f"shape {m.data.shape} does not fit encoding {m.encoding}")
    step = width * CHANNELS[m.encoding]
    return ros("sensor_msgs/msg/Image")(header(m.stamp_s, OPTICAL), height, width, m.encoding, False, step, data)


def _image_from(message: Any) -> Image:
    channels = CHANNELS[message.encoding]
    if message.step != message.width * channels or message.data.size != message.height * message.step:
        raise ValueError(f"{message.data.size} bytes for {message.height} rows of {message.step}")
    shape = (message.height, message.width) if channels == 1 else (message.height, message.width, channels)
    return Image(stamp(message), np.array(message.data, np.uint8).reshape(shape), message.encoding)


def _compressed_to(m: CompressedImage) -> Any:
    return ros("sensor_msgs/msg/CompressedImage")(
        header(m.stamp_s, OPTICAL), transport_format(m.data), np.frombuffer(m.data, np.uint8)
    )


def _compressed_from(message: Any) -> CompressedImage:
    data = message.data.tobytes()
    if why := objection(data):
        raise ValueError(why)
    return CompressedImage(stamp(message), data, picture_format(data))


def _range_to(m: Range) -> Any:
    infrared, field_of_view_rad = 1, 0.26
    return ros("sensor_msgs/msg/Range")(
        header(m.stamp_s, m.frame_id),
        infrared,
        field_of_view_rad,
        m.min_range_m,
        m.max_range_m,
        m.range_m,
        0.0,
    )


def _range_from(message: Any) -> Range:
    return Range(stamp(message), message.header.frame_id, message.range, message.min_range, message.max_range)


def _battery_to(m: BatteryState) -> Any:
    unmeasured, unknown, lithium_ion = math.nan, 0, 2
    return ros("sensor_msgs/msg/BatteryState")(
        header=header(m.stamp_s, BASE),
        voltage=m.voltage_v,
        temperature=unmeasured,
        current=unmeasured,
        charge=unmeasured,
        capacity=unmeasured,
        design_capacity=unmeasured,
        percentage=unmeasured,
        power_supply_status=unknown,
        power_supply_health=unknown,
        power_supply_technology=lithium_ion,
        present=True,
        cell_voltage=_NOTHING,
        cell_temperature=_NOTHING,
        location="",
        serial_number="",
    )


def _battery_from(message: Any) -> BatteryState:
    return BatteryState(stamp(message), message.voltage)


CODECS: dict[type, Codec] = {
    LaserScan: Codec("sensor_msgs/msg/LaserScan", _scan_to, _scan_from),
    Image: Codec("sensor_msgs/msg/Image", _image_to, _image_from),
    CompressedImage: Codec("sensor_msgs/msg/CompressedImage", _compressed_to, _compressed_from),
    Range: Codec("sensor_msgs/msg/Range", _range_to, _range_from),
    BatteryState: Codec("sensor_msgs/msg/BatteryState", _battery_to, _battery_from),
}
