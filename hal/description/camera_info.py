"""What a camera projects to where: the pinhole of a profile, or a real camera's calibration file.

A calibration file is the YAML that ROS's camera_calibration writes and camera_info_manager reads.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from lira.hal.config import read_bounded
from lira.hal.errors import ConfigError
from lira.hal.messages import CameraInfo
from lira.hal.profile import Camera

LONGEST_BYTES = 64 * 1024
SHAPES = {"camera_matrix": 9, "rectification_matrix": 9, "projection_matrix": 12}
MODELS = {"plumb_bob": 5, "rational_polynomial": 8, "equidistant": 4}  # and how many coefficients each has
SAME_SHAPE = 0.03  # of width to height, as pictures are scaled by


def pinhole(camera: Camera, width: int, height: int, stamp_s: float = 0.0) -> CameraInfo:
    """Return what the profile's camera projects into pictures of this size: no distortion, the axis in the middle."""
    fx = width / 2 / math.tan(camera.hfov_rad / 2)
    fy = height / 2 / math.tan(camera.vfov_rad / 2)
    # The middle of a row of n pixels, of which the first is centred at 0.
    return _info(stamp_s, width, height, (fx, fy, (width - 1) / 2, (height - 1) / 2))


def info_for(info: CameraInfo, size: tuple[int, int], stamp_s: float) -> CameraInfo:
    """Return it for pictures of another size (width, height). Raises `ValueError` if that is another shape."""
    x, y = size[0] / info.width, size[1] / info.height
    if abs(x / y - 1.0) > SAME_SHAPE:
        what = f"it is for pictures of {info.width} x {info.height}, these are {size[0]} x {size[1]}"
        raise ValueError(f"{what}: another shape")
    if (x, y) == (1.0, 1.0):
        return replace(info, stamp_s=stamp_s)
    k, p = _resized(info.k, 3, (x, y)), _resized(info.p, 4, (x, y))
    return replace(info, stamp_s=stamp_s, width=size[0], height=size[1], k=k, p=p)


def _resized(matrix: tuple[float, ...], columns: int, scales: tuple[float, float]) -> tuple[float, ...]:
    """Focal lengths and offsets grow with the picture, whose first pixel stays centred at 0."""
    rows = [list(matrix[at : at + columns]) for at in range(0, len(matrix), columns)]
    for row, scale in zip(rows, scales, strict=False):
        row[:] = [value * scale for value in row]
        row[2] += (scale - 1.0) / 2
    return tuple(value for row in rows for value in row)


def load_calibration(path: Path, camera: Camera) -> CameraInfo:
    """Read a calibration, for pictures of the profile's size. Raises `ConfigError`."""
    from ruamel.yaml import YAML  # few have a file, and every start would pay for it
    from ruamel.yaml.error import YAMLError

    try:
        said = YAML(typ="safe", pure=True).load(read_bounded(path, LONGEST_BYTES))
        return info_for(_read(said), (camera.width_px, camera.height_px), 0.0)
    except (YAMLError, RecursionError, KeyError, TypeError, ValueError, OverflowError) as error:
        what = f"{path} is no camera calibration: {' '.join(str(error).split())[:200]}"
        raise ConfigError(what, "Take the YAML that ROS's camera_calibration writes.") from error


def _read(said: Any) -> CameraInfo:
    """Raises `KeyError`, `TypeError` or `ValueError` for what is missing or makes no sense."""
    width, height = int(said["image_width"]), int(said["image_height"])
    matrices = {name: _numbers(said[name]["data"], count) for name, count in SHAPES.items()}
    model = said["distortion_model"]
    if model not in MODELS:
        raise ValueError(f"distortion_model {model!r}, known: {', '.join(MODELS)}")
    k = matrices["camera_matrix"]
    if not (0 < width <= 2**16 and 0 < height <= 2**16 and k[0] > 0.0 and k[4] > 0.0):
        raise ValueError("its size and focal lengths have to be positive")
    d = _numbers(said["distortion_coefficients"]["data"], MODELS[model])
    return CameraInfo(0.0, width, height, k, matrices["projection_matrix"], d, matrices["rectification_matrix"], model)


def _numbers(values: Any, count: int) -> tuple[float, ...]:
    numbers = tuple(map(float, values))
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise ValueError(f"{len(numbers)} numbers where {count} finite ones belong")
    return numbers


def _info(stamp_s: float, width: int, height: int, lens: tuple[float, float, float, float]) -> CameraInfo:
    fx, fy, cx, cy = lens
    k = (fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
    p = (fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0)
    return CameraInfo(stamp_s, width, height, k, p, (0.0,) * MODELS["plumb_bob"])
