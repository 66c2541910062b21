"""A floor in pybullet: one client per scene.

Everything is drawn flat, each surface in exactly its own gray: TinyRenderer with ambient light only, and all normals
up, so that the OpenGL renderer's lamp above shades every face alike. A black box in front of a black line is then as
invisible as the thesis has it.
"""

import importlib.util
import math
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import TypeVar

import numpy as np

from lira.hal.errors import ConfigError
from lira.hal.messages import ByteArray, FloatArray
from lira.sim_backend.layout import Block, Layout
from lira.sim_backend.polyline import Floats
from lira.sim_backend.scenes.base import (
    FAR_M,
    NEAR_M,
    Drawer,
    Pixels,
    Pose,
    View,
    backdrop,
    floor_distances_m,
)
from lira.sim_backend.scenes.shapes import Faces, box_mesh, join, obj_text, paint
from lira.sim_backend.scenes.silence import quiet
from lira.sim_backend.world import Mesh

T = TypeVar("T")

# Boxes go into as few bodies as pybullet allows: TinyRenderer's time goes by bodies more than by triangles.
GROUP = 16


def import_pybullet() -> ModuleType:
    """Import pybullet, or raise `ConfigError`."""
    try:
        with quiet():
            import pybullet
    except ImportError as error:
        raise ConfigError(
            "pybullet is not installed",
            "Use the renderer 'sketch', or install it: pip install pybullet (compiles, but for Python 3.11 on x86-64).",
        ) from error
    module: ModuleType = pybullet
    return module


class BulletScene:
    """A line and boxes in a pybullet client of its own; the floor is the camera's business. Not thread-safe.

    With `egl` it tries to load the OpenGL renderer; `self.drawer` says whether that worked.
    """

    def __init__(self, layout: Layout, *, egl: bool = False) -> None:
        self.bullet = import_pybullet()
        self.client: int = self.bullet.connect(self.bullet.DIRECT)
        # OpenGL draws into whatever belongs to the calling thread: each scene that uses it has a thread of its own.
        self._painter = ThreadPoolExecutor(1, "egl") if egl else None
        # Before the first shape: the plugin learns of shapes as they are made.
        self.drawer: Drawer = "egl" if egl and self._paint(self._load_egl) else "tiny"
        self.arrange(layout)

    def arrange(self, layout: Layout) -> None:
        """Build everything anew from a layout: cheap, and nothing is left of the last one."""
        self._grays = layout.world.sky_gray, layout.world.ground_gray
        self._paint(partial(self._build, layout))

    def photograph(self, view: View, pose: Pose) -> ByteArray:
        """Draw what the camera sees: uint8 [height, width] of the view."""
        pixels, depth = self.shoot(self.picture_request(view, pose))
        return np.where(depth < 1.0, pixels[..., 0], backdrop(view, *self._grays))

    def distances_m(self, view: View, pose: Pose, rows: Pixels, columns: Pixels) -> Floats:
        """Distances along the optical axis at some pixels of a view, [rows, columns]; infinite where nothing is."""
        _, buffer = self.shoot(self.picture_request(view, pose))
        along_m = axis_distance_m(buffer[rows][:, columns])
        return np.minimum(along_m, floor_distances_m(view)[rows, None])

    def ranges_m(self, origin: tuple[float, float, float], angles_rad: Floats, reach_m: float) -> Floats:
        """Distances from a point to the first box along level rays [n]; infinite beyond `reach_m`."""
        hits = self.bullet.rayTestBatch(**self.ray_request(origin, angles_rad, reach_m))
        return np.array([hit[2] if hit[0] >= 0 else math.inf for hit in hits]) * reach_m

    def picture_request(self, view: View, pose: Pose) -> dict[str, object]:
        """Return the arguments of pybullet's `getCameraImage`."""
        egl = self.drawer == "egl"
        # TinyRenderer samples each pixel at its corner instead of its middle, OpenGL does not.
        shift = (0.0, 0.0) if egl else (1 / view.width_px, 1 / view.height_px)
        return {
            "width": view.width_px,
            "height": view.height_px,
            "projectionMatrix": projection_matrix(view, shift),
            "viewMatrix": view_matrix(view, pose),
            "shadow": 0,
            "lightAmbientCoeff": 1.0,
            "lightDiffuseCoeff": 0.0,
            "lightSpecularCoeff": 0.0,
            "lightDirection": [0.0, 0.0, 1.0],
            "flags": self.bullet.ER_NO_SEGMENTATION_MASK,
            "renderer": self.bullet.ER_BULLET_HARDWARE_OPENGL if egl else self.bullet.ER_TINY_RENDERER,
            "physicsClientId": self.client,
        }

    def ray_request(self, origin: tuple[float, float, float], angles_rad: Floats, reach_m: float) -> dict[str, object]:
        """Return the arguments of pybullet's `rayTestBatch`."""
        ends = np.full((len(angles_rad), 3), origin)
        ends[:, 0] += reach_m * np.cos(angles_rad)
        ends[:, 1] += reach_m * np.sin(angles_rad)
        return {
            "rayFromPositions": [origin] * len(angles_rad),
            "rayToPositions": ends.tolist(),
            "physicsClientId": self.client,
        }

    def shoot(self, request: dict[str, object]) -> tuple[ByteArray, FloatArray]:
        """Call pybullet's `getCameraImage`: pixels [height, width, 4] and depth [height, width], 1 where nothing is."""
        _, _, pixels, depth, _ = self._paint(partial(self.bullet.getCameraImage, **request))
        return pixels, depth

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
        bullet = self.bullet
        bullet.resetSimulation(physicsClientId=self.client)
        # Or pybullet keeps every mesh file it has ever read.
        bullet.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=self.client)
        for gray, faces in paint(layout):
            self._draw(faces, gray)
        for gray in sorted({block.gray for block in layout.blocks}):
            alike = [block for block in layout.blocks if block.gray == gray]
            for first in range(0, len(alike), GROUP):
                group = alike[first : first + GROUP]
                self._draw(join([box_mesh(block) for block in group]), gray, self._solid(group))
        for mesh in layout.world.mesh:
            self._furnish(mesh)
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

    def _furnish(self, mesh: Mesh) -> None:
        """Put a thing from a file onto the floor. Raises `ConfigError` if pybullet cannot read it."""
        bullet, yaw_rad = self.bullet, math.radians(mesh.yaw_deg)
        place = {
            "basePosition": [mesh.x_m, mesh.y_m, mesh.z_m],
            "baseOrientation": [0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)],
            "physicsClientId": self.client,
        }
        try:
            with quiet():
                if mesh.path.endswith(".urdf"):
                    body = bullet.loadURDF(mesh.path, useFixedBase=True, globalScaling=mesh.scale, **place)
                else:
                    body = bullet.createMultiBody(0, *self._shapes(mesh), **place)
        except bullet.error as error:
            raise ConfigError(
                f"pybullet cannot read {mesh.path}: {error}", "Mend the file, or leave it out."
            ) from error
        for part in bullet.getVisualShapeData(body, physicsClientId=self.client):
            colour = [*[shade(mesh.gray)] * 3, 1.0]
            bullet.changeVisualShape(body, part[1], rgbaColor=colour, physicsClientId=self.client)

    def _shapes(self, mesh: Mesh) -> tuple[int, int]:
        """What rays meet of a mesh's file, triangle by triangle, and what is seen of it."""
        bullet = self.bullet
        how = {"fileName": mesh.path, "meshScale": [mesh.scale] * 3, "physicsClientId": self.client}
        solid = bullet.createCollisionShape(bullet.GEOM_MESH, flags=bullet.GEOM_FORCE_CONCAVE_TRIMESH, **how)
        return solid, bullet.createVisualShape(bullet.GEOM_MESH, **how)

    def _draw(self, faces: Faces, gray: int, solid: int = -1) -> None:
        """Add a body; without a solid it is a picture only."""
        level = shade(gray)
        with tempfile.TemporaryDirectory() as folder:
            # A file, because the OpenGL plugin crashes on a mesh handed over in memory.
            path = Path(folder) / "mesh.obj"
            path.write_text(obj_text(faces), encoding="ascii")
            visual = self.bullet.createVisualShape(
                self.bullet.GEOM_MESH,
                fileName=str(path),
                rgbaColor=[level, level, level, 1.0],
                physicsClientId=self.client,
            )
            self.bullet.createMultiBody(0, solid, visual, physicsClientId=self.client)


def shade(gray: int) -> float:
    """A gray as a share: a little above the one asked for, as the renderers cut off where they should round."""
    return min((gray + 0.25) / 255, 1.0)


def axis_distance_m(buffer: FloatArray) -> Floats:
    """Distances along the optical axis from OpenGL's depth buffer; infinite where nothing was drawn."""
    near, far = NEAR_M, FAR_M
    distance_m: Floats = far * near / (far - (far - near) * buffer.astype(np.float64))
    return np.where(buffer < 1.0, distance_m, np.inf)


def projection_matrix(view: View, shift: tuple[float, float] = (0.0, 0.0)) -> list[float]:
    """OpenGL projection, column by column. `shift` moves the picture, in halves of its width and height."""
    wide, high = view.tangents
    depth = FAR_M - NEAR_M
    return [
        *(1 / wide, 0.0, 0.0, 0.0),
        *(0.0, 1 / high, 0.0, 0.0),
        *(*shift, -(FAR_M + NEAR_M) / depth, -1.0),
        *(0.0, 0.0, -2 * FAR_M * NEAR_M / depth, 0.0),
    ]


def view_matrix(view: View, pose: Pose) -> list[float]:
    """OpenGL view, column by column; OpenGL looks along its own -z."""
    turn = np.eye(4)
    turn[:3, :3] = (view.axes(pose) * (1.0, 1.0, -1.0)).T
    turn[:3, 3] = -turn[:3, :3] @ view.eye(pose)
    matrix: list[float] = turn.T.reshape(-1).tolist()
    return matrix
