"""The pybullet side of a layout: what the camera sees and the lidar hits. One client per scene.

Everything is drawn flat, each surface in exactly its own gray: TinyRenderer with ambient light only, and all normals
up, so that the OpenGL renderer's lamp above shades every face alike. A black box in front of a black line is then as
invisible as the thesis has it.
"""

import ctypes
import importlib.util
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import numpy as np

from hal.errors import MissingExtraError
from sim_backend.layout import Block, Layout
from sim_backend.polyline import Floats, Polyline
from sim_backend.world import Line

FLOOR_M = 200.0
# High enough over the floor not to flicker into it far away, too low to matter to the camera.
PAINT_HEIGHT_M = 0.003
PAINT_STEP_M = 0.3
UNDERGROUND = (0.0, 0.0, -1000.0)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)

# Corners [n, 3] and the triangles between them, three indices each.
Mesh = tuple[Floats, list[int]]
Shape = tuple[float, float, float, int]


def import_pybullet() -> ModuleType:
    """Import pybullet, or raise `MissingExtraError`."""
    try:
        with quiet():
            import pybullet
    except ImportError as error:
        raise MissingExtraError("pybullet", "sim") from error
    module: ModuleType = pybullet
    return module


@contextmanager
def quiet() -> Iterator[None]:
    """Keep what pybullet prints from C out of the standard output, which may be a report that a program reads."""
    libc = ctypes.CDLL(None)
    sys.stdout.flush()
    libc.fflush(None)
    kept = os.dup(1)
    try:
        with open(os.devnull, "wb") as nowhere:  # noqa: PTH123
            os.dup2(nowhere.fileno(), 1)
        yield
    finally:
        libc.fflush(None)
        os.dup2(kept, 1)
        os.close(kept)


class Scene:
    """A floor with a line and boxes in a pybullet client of its own. Not thread-safe.

    With `egl` it tries to load the OpenGL renderer; `self.egl` says whether that worked.
    """

    def __init__(self, layout: Layout, *, egl: bool = False) -> None:
        self.bullet = import_pybullet()
        self.client: int = self.bullet.connect(self.bullet.DIRECT)
        # Before the first shape: the plugin learns of shapes as they are made.
        self.egl = egl and self._load_egl()
        self._boxes: dict[Shape, list[int]] = {}
        world = layout.world
        self._draw(floor_mesh(), world.ground_gray)
        if world.line is not None:
            self._draw(ribbon_mesh(layout.curve, world.line), world.line.gray)
        self.arrange(layout)

    def arrange(self, layout: Layout) -> None:
        """Move the boxes to where another layout of the same world has them. Boxes are reused, so this is cheap."""
        spare = {shape: list(bodies) for shape, bodies in self._boxes.items()}
        for block in layout.blocks:
            shape = (block.length_m, block.width_m, block.height_m, block.gray)
            body = spare[shape].pop() if spare.get(shape) else self._box(shape)
            self._move(body, (block.x_m, block.y_m, block.height_m / 2), yaw_quaternion(block))
        for bodies in spare.values():
            for body in bodies:
                self._move(body, UNDERGROUND, UPRIGHT)
        self.bullet.performCollisionDetection(physicsClientId=self.client)

    def close(self) -> None:
        """Let go of the client. May be called twice."""
        if self.client >= 0:
            with quiet():
                self.bullet.disconnect(physicsClientId=self.client)
            self.client = -1

    def _load_egl(self) -> bool:
        plugin = importlib.util.find_spec("eglRenderer")
        if plugin is None or plugin.origin is None:
            return False
        with quiet():
            number: int = self.bullet.loadPlugin(plugin.origin, "_eglRendererPlugin", physicsClientId=self.client)
        return number >= 0

    def _box(self, shape: Shape) -> int:
        half = [edge / 2 for edge in shape[:3]]
        solid = self.bullet.createCollisionShape(self.bullet.GEOM_BOX, halfExtents=half, physicsClientId=self.client)
        body = self._draw(box_mesh(half), shape[3], solid)
        self._boxes.setdefault(shape, []).append(body)
        return body

    def _draw(self, mesh: Mesh, gray: int, solid: int = -1) -> int:
        """Add a body; without a solid it is a picture only."""
        # A little above the gray asked for: the renderers cut off where they should round.
        shade = min((gray + 0.25) / 255, 1.0)
        with tempfile.TemporaryDirectory() as folder:
            # A file, because the OpenGL plugin crashes on a mesh handed over in memory.
            path = Path(folder) / "mesh.obj"
            path.write_text(obj_text(mesh), encoding="ascii")
            visual = self.bullet.createVisualShape(
                self.bullet.GEOM_MESH,
                fileName=str(path),
                rgbaColor=[shade, shade, shade, 1.0],
                physicsClientId=self.client,
            )
            body: int = self.bullet.createMultiBody(0, solid, visual, physicsClientId=self.client)
        return body

    def _move(self, body: int, position: tuple[float, float, float], turn: tuple[float, float, float, float]) -> None:
        self.bullet.resetBasePositionAndOrientation(body, position, turn, physicsClientId=self.client)


def yaw_quaternion(block: Block) -> tuple[float, float, float, float]:
    """x, y, z, w of a turn about the vertical."""
    return 0.0, 0.0, float(np.sin(block.yaw_rad / 2)), float(np.cos(block.yaw_rad / 2))


def floor_mesh() -> Mesh:
    """One square, facing up."""
    far = FLOOR_M
    return np.array([[-far, -far, 0], [far, -far, 0], [far, far, 0], [-far, far, 0]], dtype=np.float64), [
        0,
        1,
        2,
        0,
        2,
        3,
    ]


def ribbon_mesh(curve: Polyline, line: Line) -> Mesh:
    """Two triangles for each stretch of the line, facing up."""
    count = max(round(curve.length_m / PAINT_STEP_M), 1)
    edges = []
    for at_m in np.linspace(0.0, curve.length_m, count + 1):
        for side in (-0.5, 0.5):
            x, y, _ = curve.pose(float(at_m), side * line.width_m)
            edges.append((x, y, PAINT_HEIGHT_M))
    indices = [corner for k in range(0, 2 * count, 2) for corner in (k, k + 2, k + 1, k + 1, k + 2, k + 3)]
    return np.array(edges), indices


def box_mesh(half: list[float]) -> Mesh:
    """The six faces of a box, two triangles each, facing out."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(half)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, [index for a, b, c, d in faces for index in (a, b, c, a, c, d)]


def obj_text(mesh: Mesh) -> str:
    """Write a mesh as a Wavefront file, with every normal up."""
    corners, indices = mesh
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in corners]
    lines.append("vn 0 0 1")
    for triangle in np.array(indices).reshape(-1, 3) + 1:
        lines.append("f " + " ".join(f"{corner}//1" for corner in triangle))
    return "\n".join(lines) + "\n"
