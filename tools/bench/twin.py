"""The twin in process: how many times faster than real time, and beside pybullet's own calls for the same sensors."""

import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from lira.hal.messages import Command, Episode, Observation, Twist
from lira.hal.profile import RobotProfile, load_profile
from lira.sim_backend.lidar import RayLidar
from lira.sim_backend.sensors import open_camera
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
    """Return one row per profile."""
    return [measure(load) for load in LOADS]


def measure(load: Load) -> Row:
    """Time runs of the twin, each followed by the bare calls from the very same poses."""
    profile = load_profile(load.profile)
    twin = Twin(profile, WORLD)
    twin.open()
    try:
        with bare_calls(profile, twin, load) as calls:
            pairs = [(timed(lambda: drive(twin, load)), timed(lambda: make(calls))) for _ in range(RUNS)]
        renderer = twin.renderer
    finally:
        twin.close()
    factors = [load.run_s / ours_s for ours_s, _ in pairs]
    return {
        "profile": load.profile,
        "renderer": renderer,
        "image": f"{profile.camera.width_px}x{profile.camera.height_px}",
        "real_time_factor": statistics.median(factors),
        "ratio_to_bare": statistics.median(ours_s / bare_s for ours_s, bare_s in pairs),
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
    """Everything the twin asks pybullet for in a run, ready to be called on a scene of its own."""
    camera = open_camera(profile.camera, twin.layout, "egl" if twin.renderer == "egl" else "tiny")
    lidar = RayLidar(profile.lidar, camera.scene, np.random.default_rng(0))
    bullet = camera.scene.bullet
    calls: list[Call] = []

    def remember(seen: Observation) -> None:
        state = twin.state()
        pose = (state.x_m, state.y_m, state.yaw_rad)
        if seen.image is not None and seen.image.stamp_s == state.stamp_s:
            request = camera.request(*pose)
            calls.append(lambda: camera.scene.photograph(request))
        if seen.scan is not None and seen.scan.stamp_s == state.stamp_s:
            rays = lidar.request(*pose)
            calls.append(lambda: bullet.rayTestBatch(**rays))

    drive(twin, load, remember)
    try:
        yield calls
    finally:
        camera.scene.close()


def make(calls: list[Call]) -> None:
    """Make the bare calls, and keep nothing."""
    for call in calls:
        call()


def timed(work: Call) -> float:
    """Seconds that a piece of work takes."""
    began_s = time.perf_counter()
    work()
    return time.perf_counter() - began_s
