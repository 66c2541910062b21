"""A floor drawn and measured by plain geometry: no pybullet, no OpenGL, and the same pictures but along edges."""

import numpy as np

from lira.hal.messages import ByteArray
from lira.sim_backend.layout import Layout
from lira.sim_backend.polyline import Floats
from lira.sim_backend.scenes.base import Drawer, Pixels, Pose, View, backdrop, floor_distances_m
from lira.sim_backend.scenes.meshes import paint
from lira.sim_backend.scenes.prisms import Prisms
from lira.sim_backend.scenes.scanline import fill, out_of_view


class SketchScene:
    """Paint on the floor and boxes on it, drawn far to near."""

    drawer: Drawer = "sketch"

    def __init__(self, layout: Layout) -> None:
        self.arrange(layout)

    def arrange(self, layout: Layout) -> None:
        """Take another layout."""
        world = layout.world
        self._grays = world.sky_gray, world.ground_gray
        self._prisms = Prisms(layout.blocks)
        self._paint = list(paint(layout))

    def photograph(self, view: View, pose: Pose) -> ByteArray:
        """Draw the picture: uint8 [height, width]."""
        picture = backdrop(view, *self._grays).copy()
        eye, axes = view.eye(pose), view.axes(pose) / (*view.tangents, 1.0)
        for gray, (corners, faces) in self._paint:
            fill(picture, (corners - eye) @ axes, faces, gray)
        prisms = self._prisms
        if len(prisms.gray):
            corners = (prisms.corners - eye) @ axes
            seen = np.flatnonzero(~out_of_view(corners))
            facing = prisms.facing(eye)
            for group in prisms.far_to_near(seen, facing, eye):
                if len(group):
                    faces = prisms.faces[group][facing[group]]
                    fill(picture, corners.reshape(-1, 3), faces, int(prisms.gray[group[0]]))
        return picture

    def distances_m(self, view: View, pose: Pose, rows: Pixels, columns: Pixels) -> Floats:
        """Distances along the optical axis at some pixels, [rows, columns]."""
        wide, high = view.tangents
        right = ((2.0 * columns + 1.0) / view.width_px - 1.0) * wide
        up = (1.0 - (2.0 * rows + 1.0) / view.height_px) * high
        eye, axes = view.eye(pose), view.axes(pose)
        ways = np.stack(np.broadcast_arrays(right, up[:, None], 1.0)).reshape(3, -1)  # one metre along the axis each
        corners = (self._prisms.corners - eye) @ axes / (wide, high, 1.0)
        seen = np.flatnonzero(~out_of_view(corners))
        boxes_m = self._prisms.distances_m(eye, axes @ ways, seen).reshape(len(rows), len(columns))
        return np.minimum(boxes_m, floor_distances_m(view)[rows, None])

    def ranges_m(self, origin: tuple[float, float, float], angles_rad: Floats, reach_m: float) -> Floats:
        """Distances to the first box along level rays [n] from one point; infinite beyond `reach_m`."""
        return self._prisms.ranges_m(origin, angles_rad, reach_m)

    def close(self) -> None:
        """Nothing is held."""
