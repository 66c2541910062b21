"""A floor drawn and measured by plain geometry: no pybullet, no OpenGL, and the same pictures but along edges."""

from collections.abc import Iterable

import numpy as np

from lira.hal.messages import ByteArray
from lira.sim_backend.layout import Layout
from lira.sim_backend.polyline import Floats
from lira.sim_backend.scenes.base import Drawer, Pixels, Pose, View, backdrop, floor_distances_m
from lira.sim_backend.scenes.facets import Facets, project
from lira.sim_backend.scenes.prisms import Flags, Prisms
from lira.sim_backend.scenes.scanline import cover
from lira.sim_backend.scenes.shapes import Indices

BOX_FACES = 6


class SketchScene:
    """Paint on the floor and boxes on it, drawn far to near."""

    drawer: Drawer = "sketch"

    def __init__(self, layout: Layout) -> None:
        self.arrange(layout)

    def arrange(self, layout: Layout) -> None:
        """Take another layout."""
        self._backdrop = layout.world.sky_gray, layout.world.ground_gray
        self._facets = Facets(layout)
        self._prisms = Prisms(layout.blocks)

    def photograph(self, view: View, pose: Pose) -> ByteArray:
        """Draw the picture: uint8 [height, width]."""
        picture = backdrop(view, *self._backdrop)
        facets, eye, axes = self._facets, view.eye(pose), view.axes(pose)
        facing = facets.facing(eye)
        (seen,) = (facing & facets.in_view(view, eye, axes)).nonzero()
        for group in self._far_to_near(seen, facing, eye):
            if not len(group):
                continue
            cover(picture, project(facets.corners.take(group, 0), view, eye, axes), int(facets.gray[group[0]]))
        return picture

    def _far_to_near(self, seen: Indices, facing: Flags, eye: Floats) -> Iterable[Indices]:
        """Sort faces into an order to paint them in: groups of one gray, each over those before it."""
        facets = self._facets
        gray = facets.gray[seen]
        if not len(seen) or (gray == gray[0]).all():
            return [seen]
        painted = int(np.searchsorted(seen, facets.painted))
        layers = np.split(seen[:painted], np.flatnonzero(np.diff(gray[:painted])) + 1)
        faces = seen[painted:]
        owner = (faces - facets.painted) // BOX_FACES
        boxes = self._prisms.far_to_near(np.unique(owner), facing[facets.painted :].reshape(-1, BOX_FACES), eye)
        return [*layers, *(faces[np.isin(owner, group)] for group in boxes)]

    def distances_m(self, view: View, pose: Pose, rows: Pixels, columns: Pixels) -> Floats:
        """Distances along the optical axis at some pixels, [rows, columns]."""
        wide, high = view.tangents
        right = ((2.0 * columns + 1.0) / view.width_px - 1.0) * wide
        up = (1.0 - (2.0 * rows + 1.0) / view.height_px) * high
        ways = np.stack(np.broadcast_arrays(right, up[:, None], 1.0)).reshape(3, -1)  # one metre along the axis each
        eye, axes = view.eye(pose), view.axes(pose)
        seen = np.flatnonzero(self._facets.in_view(view, eye, axes)[self._facets.painted :])
        boxes_m = self._prisms.distances_m(eye, axes @ ways, np.unique(seen // BOX_FACES))
        return np.minimum(boxes_m.reshape(len(rows), len(columns)), floor_distances_m(view)[rows, None])

    def ranges_m(self, origin: tuple[float, float, float], angles_rad: Floats, reach_m: float) -> Floats:
        """Distances to the first box along level rays [n] from one point; infinite beyond `reach_m`."""
        return self._prisms.ranges_m(origin, angles_rad, reach_m)

    def close(self) -> None:
        """Nothing is held."""
