"""The pybullet side of a layout: what the camera sees and the lidar hits. One client per scene.

Everything is drawn flat, each surface in exactly its own gray: TinyRenderer with ambient light only, and all normals
up, so that the OpenGL renderer's lamp above shades every face alike. A black box in front of a black line is then as
invisible as the thesis has it.
"""

import ctypes
import importlib.util
import math
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from functools import partial
from itertools import groupby
from pathlib import Path
from types import ModuleType
from typing import TypeVar

import numpy as np

from lira.hal.errors import MissingExtraError
from lira.hal.messages import ByteArray, FloatArray
from lira.sim_backend.layout import Block, Layout, Mark
from lira.sim_backend.polyline import Floats, Polyline
from lira.sim_backend.world import Line

T = TypeVar("T")

PAINT_STEP_M = 0.3
# Paint over paint: each layer lies this far above the one before, the line on top at height 0. The floor itself is not
# drawn, so nothing hides what is below it.
LAYER_M = 0.001

# Boxes go into as few bodies as pybullet allows: TinyRenderer's time goes by bodies more than by triangles.
GROUP = 16
# Corners [n, 3] and the triangles between them, three indices each.
Mesh = tuple[Floats, list[int]]


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
    """Keep what pybullet prints from C off the screen and out of a report that a program reads.

    A process that may open no more files is not quiet, but goes on.
    """
    libc = ctypes.CDLL(None)
    sys.stdout.flush()
    sys.stderr.flush()
    libc.fflush(None)
    with ExitStack() as stack:
        try:
            kept = [_open(stack, os.dup, stream) for stream in (1, 2)]
            nowhere = _open(stack, os.open, os.devnull, os.O_WRONLY)
        except OSError:
            yield
            return
        try:
            for stream in (1, 2):
                os.dup2(nowhere, stream)
            yield
        finally:
            libc.fflush(None)
            for stream, copy in zip((1, 2), kept, strict=True):
                os.dup2(copy, stream)


def _open(stack: ExitStack, opener: Callable[..., int], *words: object) -> int:
    descriptor = opener(*words)
    stack.callback(os.close, descriptor)
    return descriptor


class Scene:
    """A line and boxes in a pybullet client of its own; the floor is the camera's business. Not thread-safe.

    With `egl` it tries to load the OpenGL renderer; `self.egl` says whether that worked.
    """

    def __init__(self, layout: Layout, *, egl: bool = False) -> None:
        self.bullet = import_pybullet()
        self.client: int = self.bullet.connect(self.bullet.DIRECT)
        self.sky_gray, self.ground_gray = layout.world.sky_gray, layout.world.ground_gray
        # OpenGL draws into whatever belongs to the calling thread: each scene that uses it has a thread of its own.
        self._painter = ThreadPoolExecutor(1, "egl") if egl else None
        # Before the first shape: the plugin learns of shapes as they are made.
        self.egl = egl and self._paint(self._load_egl)
        self.arrange(layout)

    def arrange(self, layout: Layout) -> None:
        """Build everything anew from a layout: cheap, and nothing is left of the last one."""
        self._paint(partial(self._build, layout))

    def photograph(self, request: dict[str, object]) -> tuple[ByteArray, FloatArray]:
        """Call pybullet's `getCameraImage`: pixels [height, width, 4] and depth [height, width], 1 where nothing is."""
        _, _, pixels, depth, _ = self._paint(partial(self.bullet.getCameraImage, **request))
        return pixels, depth

    def cast(self, starts: Floats, ends: Floats) -> Floats:
        """Return the share of each ray, from and to [n, 3], that is free; 1 where it meets nothing."""
        hits = self.bullet.rayTestBatch(starts.tolist(), ends.tolist(), physicsClientId=self.client)
        return np.array([hit[2] if hit[0] >= 0 else 1.0 for hit in hits])

    def close(self) -> None:
        """Let go of the client. May be called twice."""
        if self.client >= 0:
            with quiet():
                self._paint(partial(self.bullet.disconnect, physicsClientId=self.client))
            self.client = -1
        if self._painter is not None:
            self._painter.shutdown()

    def _paint(self, work: Callable[[], T]) -> T:
        """Do what OpenGL may have a part in."""
        return work() if self._painter is None else self._painter.submit(work).result()

    def _build(self, layout: Layout) -> None:
        bullet, world = self.bullet, layout.world
        bullet.resetSimulation(physicsClientId=self.client)
        # Or pybullet keeps every mesh file it has ever read.
        bullet.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=self.client)
        if world.line is not None and world.line.painted:
            self._draw(ribbon_mesh(layout.curve, world.line), world.line.gray)
        layers = [list(alike) for _, alike in groupby(layout.marks, lambda mark: mark.gray)]
        for number, layer in enumerate(layers):
            z_m = (number - len(layers)) * LAYER_M
            self._draw(join([mark_mesh(mark, z_m) for mark in layer]), layer[0].gray)
        for gray in sorted({block.gray for block in layout.blocks}):
            alike = [block for block in layout.blocks if block.gray == gray]
            for first in range(0, len(alike), GROUP):
                group = alike[first : first + GROUP]
                self._draw(join([box_mesh(block) for block in group]), gray, self._solid(group))
        bullet.performCollisionDetection(physicsClientId=self.client)

    def _load_egl(self) -> bool:
        plugin = importlib.util.find_spec("eglRenderer")
        if plugin is None or plugin.origin is None:
            return False
        with quiet():
            number: int = self.bullet.loadPlugin(plugin.origin, "_eglRendererPlugin", physicsClientId=self.client)
        return number >= 0

    def _solid(self, blocks: list[Block]) -> int:
        """Make one shape of some boxes for the lidar to meet."""
        shape: int = self.bullet.createCollisionShapeArray(
            shapeTypes=[self.bullet.GEOM_BOX] * len(blocks),
            halfExtents=[[block.length_m / 2, block.width_m / 2, block.height_m / 2] for block in blocks],
            collisionFramePositions=[[block.x_m, block.y_m, block.bottom_m + block.height_m / 2] for block in blocks],
            collisionFrameOrientations=[
                [0.0, 0.0, math.sin(block.yaw_rad / 2), math.cos(block.yaw_rad / 2)] for block in blocks
            ],
            physicsClientId=self.client,
        )
        return shape

    def _draw(self, mesh: Mesh, gray: int, solid: int = -1) -> None:
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
            self.bullet.createMultiBody(0, solid, visual, physicsClientId=self.client)


def ribbon_mesh(curve: Polyline, line: Line) -> Mesh:
    """Two triangles for each stretch of the line, facing up."""
    count = max(round(curve.length_m / PAINT_STEP_M), 1)
    edges = []
    for at_m in np.linspace(0.0, curve.length_m, count + 1):
        for side in (-0.5, 0.5):
            x, y, _ = curve.pose(float(at_m), line.offset_m + side * line.width_m)
            edges.append((x, y, 0.0))
    return np.array(edges), strip(count)


def mark_mesh(mark: Mark, z_m: float) -> Mesh:
    """Two triangles for each stretch of a rectangle along its longer side, facing up."""
    lengthwise = mark.length_m >= mark.width_m
    long_m, short_m = (mark.length_m, mark.width_m) if lengthwise else (mark.width_m, mark.length_m)
    yaw_rad = mark.yaw_rad if lengthwise else mark.yaw_rad + math.pi / 2
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    count = math.ceil(long_m / PAINT_STEP_M)
    along = np.repeat(np.linspace(-0.5, 0.5, count + 1) * long_m, 2)
    across = np.tile([-0.5, 0.5], count + 1) * short_m
    x, y = mark.x_m + cos * along - sin * across, mark.y_m + sin * along + cos * across
    return np.stack([x, y, np.full_like(x, z_m)], axis=-1), strip(count)


def strip(count: int) -> list[int]:
    """Triangles of `count` stretches between pairs of corners, right and left, one pair after the other."""
    return [corner for k in range(0, 2 * count, 2) for corner in (k, k + 2, k + 1, k + 1, k + 2, k + 3)]


def box_mesh(block: Block) -> Mesh:
    """Six faces in their place, two triangles each, facing out."""
    unit = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
    along, across, up = (unit * (block.length_m, block.width_m, block.height_m)).T
    cos, sin = math.cos(block.yaw_rad), math.sin(block.yaw_rad)
    x, y = block.x_m + cos * along - sin * across, block.y_m + sin * along + cos * across
    corners = np.stack([x, y, block.bottom_m + up], axis=-1)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, [index for a, b, c, d in faces for index in (a, b, c, a, c, d)]


def join(meshes: list[Mesh]) -> Mesh:
    """Make one mesh of several."""
    indices: list[int] = []
    count = 0
    for corners, own in meshes:
        indices += [count + index for index in own]
        count += len(corners)
    return np.concatenate([corners for corners, _ in meshes]), indices


def obj_text(mesh: Mesh) -> str:
    """Write a mesh as a Wavefront file, with every normal up."""
    corners, indices = mesh
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in corners]
    lines.append("vn 0 0 1")
    for triangle in np.array(indices).reshape(-1, 3) + 1:
        lines.append("f " + " ".join(f"{corner}//1" for corner in triangle))
    return "\n".join(lines) + "\n"
