"""The twin in process: how many times faster than real time, in each scene.

With pybullet it is put beside pybullet's own calls for the same sensors; the sketch has nothing to be put beside.
"""

import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from lira.hal.messages import Command, Episode, Observation, Twist
from lira.hal.profile import RobotProfile, load_profile
from lira.sim_backend.camera import PinholeCamera
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.lidar import RayLidar
from lira.sim_backend.scenes.base import Pose
from lira.sim_backend.scenes.bullet import BulletScene
from lira.sim_backend.scenes.opening import Renderer, settle
from lira.sim_backend.twin import Twin
from lira.tools.bench import Row

WORLD = "race"
RUNS = 7
# Beside the line, past all boxes and with all of them in sight.
LANE_M = 1.45


@dataclass(frozen=True, slots=True)
class Load:
    """One profile's work: how often the twin is read, and how long a run is, in simulated seconds."""

    profile: str
    tick_s: float
    run_s: float


# Camera and lidar at every decision; and a camera of 15 Hz with a lidar of 10 Hz, each read when it is ready.
LOADS = (Load("thesis-sim", 0.2, 40.0), Load("rosbot2", 1 / 30, 4.0))

Call = Callable[[], object]


def run() -> list[Row]:
    """Return a row for each profile and scene: pybullet's are left out where it is not installed."""
    renderers: list[Renderer] = ["sketch", "auto"] if settle("auto", load_world(WORLD)) == "auto" else ["sketch"]
    return [measure(load, renderer) for load in LOADS for renderer in renderers]


def measure(load: Load, renderer: Renderer) -> Row:
    """Time runs of the twin; with pybullet each is followed by the bare calls from the very same poses."""
    profile = load_profile(load.profile)
    twin = Twin(profile, WORLD, renderer=renderer)
    twin.open()
    try:
        drawer = twin.renderer
        runs_s, ratios = [], []
        with bare_calls(profile, twin, load) as calls:
            for _ in range(RUNS):
                runs_s.append(timed(lambda: drive(twin, load)))
                if calls:
                    ratios.append(runs_s[-1] / timed(lambda: make(calls)))
    finally:
        twin.close()
    factors = [load.run_s / run_s for run_s in runs_s]
    return {
        "profile": load.profile,
        "renderer": drawer,
        "image": f"{profile.camera.width_px}x{profile.camera.height_px}",
        "real_time_factor": statistics.median(factors),
        "ratio_to_bare": statistics.median(ratios) if ratios else None,
        "runs": factors,
    }


def drive(twin: Twin, load: Load, look: Callable[[Observation], None] | None = None) -> None:
    """Drive a stretch of the race, winding a little, and read every sensor on the way."""
    twin.reset(Episode(lateral_m=LANE_M))
    base = twin.profile.base
    for tick in range(round(load.run_s / load.tick_s)):
        seen = twin.read()
        if look is not None:
            look(seen)
        turn_rad_s = 0.1 * base.max_angular_rad_s * (-1) ** tick
        twin.drive(Command(Twist(base.max_linear_m_s, turn_rad_s), twin.now()))
        twin.wait(twin.now() + load.tick_s)


@contextmanager
def bare_calls(profile: RobotProfile, twin: Twin, load: Load) -> Iterator[list[Call]]:
    """Everything the twin asks pybullet for in a run, ready to be called on a scene of its own; nothing of a sketch."""
    if twin.renderer == "sketch":
        yield []
        return
    scene = BulletScene(twin.layout, egl=twin.renderer == "egl")
    view = PinholeCamera(profile.camera, scene).view
    lidar = RayLidar(profile.lidar, scene, np.random.default_rng(0))
    calls: list[Call] = []

    def remember(seen: Observation) -> None:
        state = twin.state()
        pose = Pose(state.x_m, state.y_m, state.yaw_rad)
        if seen.image is not None and seen.image.stamp_s == state.stamp_s:
            picture = scene.picture_request(view, pose)
            calls.append(lambda: scene.shoot(picture))
        if seen.scan is not None and seen.scan.stamp_s == state.stamp_s:
            rays = scene.ray_request(*lidar.fan(pose))
            calls.append(lambda: scene.bullet.rayTestBatch(**rays))

    drive(twin, load, remember)
    try:
        yield calls
    finally:
        scene.close()


def make(calls: list[Call]) -> None:
    """Make the bare calls, and keep nothing."""
    for call in calls:
        call()


def timed(work: Call) -> float:
    """Seconds that a piece of work takes."""
    began_s = time.perf_counter()
    work()
    return time.perf_counter() - began_s
