"""What ROS 2 drivers send, brought into the form in which our own robots send it. Pure."""

import math
from dataclasses import replace

import numpy as np

from lira.hal.messages import CompressedImage, LaserScan

PNG_START = b"\x89PNG"
FULL_RAD = math.tau - 0.1  # a scan of a whole turn may leave a beam or two out


def placed_scan(scan: LaserScan, yaw_rad: float) -> LaserScan:
    """Turn a scan from its own frame into the robot's, where the unit is mounted at `yaw_rad`.

    The result runs counter-clockwise. A scan of a whole turn begins behind the robot.
    """
    ranges, start, step = scan.ranges, scan.angle_min, scan.angle_increment
    if step < 0.0:
        ranges, start, step = ranges[::-1], start + step * (len(ranges) - 1), -step
    start = math.remainder(start + yaw_rad, math.tau)
    if len(ranges) and step * len(ranges) >= FULL_RAD:
        # Beams beyond the seam behind the robot are the first ones.
        beyond = math.ceil((math.pi - start) / step)
        if 0 < beyond < len(ranges):
            ranges, start = np.roll(ranges, -beyond), start + step * beyond - math.tau
    elif start + step * (len(ranges) - 1) > math.tau:
        start -= math.tau
    return replace(scan, ranges=np.ascontiguousarray(ranges), angle_min=start, angle_increment=step)


def plain_picture(picture: CompressedImage) -> CompressedImage:
    """Name the format by what the bytes are: image_transport writes more, such as `rgb8; jpeg compressed bgr8`."""
    return replace(picture, format="png" if picture.data.startswith(PNG_START) else "jpeg")
