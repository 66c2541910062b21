"""Which scene a twin gets: the one that is asked for, or whichever this machine has, the faster one first."""

import time
from typing import Literal

from lira.hal.errors import ConfigError
from lira.hal.profile import Camera
from lira.sim_backend.camera import PinholeCamera, is_small
from lira.sim_backend.layout import Layout
from lira.sim_backend.scenes.base import Pose, Scene
from lira.sim_backend.scenes.bullet import BulletScene, import_pybullet
from lira.sim_backend.scenes.silence import quiet
from lira.sim_backend.scenes.sketch import SketchScene
from lira.sim_backend.world import World

TRIAL_FRAMES = 3

Renderer = Literal["auto", "sketch", "tiny", "egl"]


def settle(renderer: Renderer, world: World) -> Renderer:
    """Say what "auto" means where pybullet is missing: the sketch.

    Raises `ConfigError` where pybullet is asked for and missing, and where a sketch would leave something out.
    """
    if renderer == "sketch" and world.mesh:
        raise ConfigError(
            f"world '{world.name}' has meshes, which a sketch cannot draw",
            "Use the renderer 'tiny', which is pybullet's, or make them of boxes.",
        )
    if renderer != "sketch":
        try:
            import_pybullet()
        except ConfigError:
            if renderer != "auto" or world.mesh:
                raise
            return "sketch"
    return renderer


def quickest(world: World) -> Renderer:
    """The sketch, if it can draw all there is."""
    return "auto" if world.mesh else "sketch"


def open_scene(camera: Camera, layout: Layout, renderer: Renderer) -> Scene:
    """Build the scene asked for. "auto" is pybullet where it is installed, with the faster of its two renderers.

    Raises `ConfigError` if pybullet or EGL is asked for and this machine has none.
    """
    renderer = settle(renderer, layout.world)
    if renderer == "sketch":
        return SketchScene(layout)
    if renderer == "tiny" or (renderer == "auto" and is_small(camera)):
        return BulletScene(layout)
    scene = BulletScene(layout, egl=True)
    if renderer == "egl" and scene.drawer != "egl":
        scene.close()
        raise ConfigError(
            "pybullet cannot draw with EGL on this machine",
            "Install an EGL driver (Debian: libegl1 and libgl1-mesa-dri), or use the renderer 'tiny'.",
        )
    if renderer == "egl" or scene.drawer == "tiny":
        return scene
    return faster(camera, scene, BulletScene(layout))


def faster(camera: Camera, one: Scene, other: Scene) -> Scene:
    """Keep the scene that draws a camera's picture sooner, and close the other."""
    if frame_time_s(PinholeCamera(camera, other)) < frame_time_s(PinholeCamera(camera, one)):
        one, other = other, one
    other.close()
    return one


def frame_time_s(camera: PinholeCamera) -> float:
    """Return the best time of a few pictures; the first ones also make the driver say what it has to say."""
    times_s = []
    with quiet():
        for _ in range(TRIAL_FRAMES):
            began_s = time.perf_counter()
            camera.render(Pose(0.0, 0.0, 0.0))
            times_s.append(time.perf_counter() - began_s)
    return min(times_s)
