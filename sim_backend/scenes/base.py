"""What a scene is to the sensors: something that can be photographed and that rays meet."""

import math
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lira.hal.messages import ByteArray
from lira.hal.profile import Camera
from lira.sim_backend.layout import Layout
from lira.sim_backend.polyline import Floats

NEAR_M = 0.02
FAR_M = 60.0

Drawer = Literal["sketch", "tiny", "egl"]
Pixels = NDArray[np.intp]


class Pose(NamedTuple):
    """Where a robot stands on the floor."""

    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class View:
    """A camera, and how large its picture is drawn: larger than it comes out where it is averaged afterwards."""

    camera: Camera
    width_px: int
    height_px: int
    tangents: tuple[float, float] = field(init=False)  # of half the angles of view, wide and high
    bounds: Floats = field(init=False, repr=False, compare=False)  # the view's six sides, outward, [3, 6]
    slopes: Floats = field(init=False, repr=False, compare=False)  # of its right and lower edge, [2, 1, 1]
    middle_px: Floats = field(init=False, repr=False, compare=False)  # of the picture, x and y, [2, 1, 1]

    def __post_init__(self) -> None:
        """Work out once what every picture needs. The pixels need not be square."""
        wide, high = math.tan(self.camera.hfov_rad / 2), math.tan(self.camera.vfov_rad / 2)
        sides = np.array([(1, 0, -wide), (-1, 0, -wide), (0, 1, -high), (0, -1, -high), (0, 0, -1), (0, 0, 1)])
        object.__setattr__(self, "tangents", (wide, high))
        object.__setattr__(self, "bounds", (sides / np.sqrt((sides**2).sum(1, keepdims=True))).T)
        object.__setattr__(self, "slopes", np.array([wide, -high])[:, None, None])
        object.__setattr__(self, "middle_px", np.array([self.width_px / 2, self.height_px / 2])[:, None, None])

    def eye(self, pose: Pose) -> Floats:
        """Where the camera is on a robot at this pose, [3]."""
        camera = self.camera
        ahead, aside = math.cos(pose.yaw_rad) * camera.x_m, math.sin(pose.yaw_rad) * camera.x_m
        return np.array([pose.x_m + ahead, pose.y_m + aside, camera.z_m])

    def axes(self, pose: Pose) -> Floats:
        """The camera's own directions right, up and ahead as columns, [3, 3]."""
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        down, level = math.sin(self.camera.pitch_rad), math.cos(self.camera.pitch_rad)
        return np.array([[sin, cos * down, cos * level], [-cos, sin * down, sin * level], [0.0, level, -down]])


class Scene(Protocol):
    """A floor with what lies and stands on it. One caller at a time."""

    @property
    def drawer(self) -> Drawer:
        """What draws its pictures."""

    def arrange(self, layout: Layout) -> None:
        """Take another layout; nothing is left of the last one."""

    def photograph(self, view: View, pose: Pose) -> ByteArray:
        """Draw what a robot's camera sees: grays, uint8 [height, width] of the view. Flat, without averaging."""

    def distances_m(self, view: View, pose: Pose, rows: Pixels, columns: Pixels) -> Floats:
        """Distances along the optical axis at some pixels of a view, [rows, columns]; infinite where nothing is."""

    def ranges_m(self, origin: tuple[float, float, float], angles_rad: Floats, reach_m: float) -> Floats:
        """Distances from a point to the first box along level rays [n]; infinite beyond `reach_m`."""

    def close(self) -> None:
        """Let go of it. May be called twice."""


def backdrop(view: View, sky_gray: int, ground_gray: int) -> ByteArray:
    """What is seen where nothing is drawn, uint8 [height, width]: sky, and floor below the horizon.

    The floor is flat and has no end, and the camera does not roll, so this is exact; drawing it would take
    TinyRenderer longer than everything that stands on it.
    """
    up = math.tan(view.camera.pitch_rad) / view.tangents[1]  # the horizon, from 1 at the upper edge to -1 at the lower
    sky_rows = min(max(math.ceil((1.0 - up) / 2.0 * view.height_px - 0.5), 0), view.height_px)
    picture: ByteArray = np.empty((view.height_px, view.width_px), np.uint8)
    picture[:sky_rows] = sky_gray
    picture[sky_rows:] = ground_gray
    return picture


def floor_distances_m(view: View) -> Floats:
    """Distance along the optical axis at which each row meets the floor [height]; infinite above the horizon."""
    pitch_rad = view.camera.pitch_rad
    up = 1.0 - (2.0 * np.arange(view.height_px) + 1.0) / view.height_px
    falls = math.sin(pitch_rad) - up * view.tangents[1] * math.cos(pitch_rad)  # per metre along the axis
    with np.errstate(divide="ignore"):
        return np.where(falls > 0.0, view.camera.z_m / falls, np.inf)
