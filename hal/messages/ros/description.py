"""How a robot is built, as ROS 2 messages: transforms, camera info, the model as text."""

from typing import Any

import numpy as np

from lira.hal.messages import CameraInfo, Text, Transform, Transforms
from lira.hal.messages.description import OPTICAL
from lira.hal.messages.ros.types import Codec, Vector3, header, ros, stamp, time_to

_Header = ros("std_msgs/msg/Header")
_Quaternion = ros("geometry_msgs/msg/Quaternion")
_Transform = ros("geometry_msgs/msg/Transform")
_TransformStamped = ros("geometry_msgs/msg/TransformStamped")
_RegionOfInterest = ros("sensor_msgs/msg/RegionOfInterest")


def _transforms_to(m: Transforms) -> Any:
    time = time_to(m.stamp_s)
    return ros("tf2_msgs/msg/TFMessage")(
        [
            _TransformStamped(
                _Header(time, each.parent),
                each.child,
                _Transform(Vector3(*each.translation), _Quaternion(*each.rotation)),
            )
            for each in m.transforms
        ]
    )


def _transforms_from(message: Any) -> Transforms:
    stamps = [stamp(each) for each in message.transforms]
    return Transforms(max(stamps, default=0.0), tuple(map(_transform_from, message.transforms)))


def _transform_from(message: Any) -> Transform:
    at, turned = message.transform.translation, message.transform.rotation
    return Transform(
        message.header.frame_id,
        message.child_frame_id,
        (at.x, at.y, at.z),
        (turned.x, turned.y, turned.z, turned.w),
    )


def _text_to(m: Text) -> Any:
    return ros("std_msgs/msg/String")(m.data)


def _text_from(message: Any) -> Text:
    return Text(message.data)


def _camera_info_to(m: CameraInfo) -> Any:
    not_binned, whole = 0, _RegionOfInterest(0, 0, 0, 0, False)
    matrices = (np.array(each, np.float64) for each in (m.d, m.k, m.r, m.p))
    head = header(m.stamp_s, OPTICAL)
    return ros("sensor_msgs/msg/CameraInfo")(
        head, m.height, m.width, m.distortion_model, *matrices, not_binned, not_binned, whole
    )


def _camera_info_from(message: Any) -> CameraInfo:
    k, p, d, r = (tuple(map(float, each)) for each in (message.k, message.p, message.d, message.r))
    return CameraInfo(stamp(message), message.width, message.height, k, p, d, r, message.distortion_model)


CODECS: dict[type, Codec] = {
    Transforms: Codec("tf2_msgs/msg/TFMessage", _transforms_to, _transforms_from),
    Text: Codec("std_msgs/msg/String", _text_to, _text_from),
    CameraInfo: Codec("sensor_msgs/msg/CameraInfo", _camera_info_to, _camera_info_from),
}
