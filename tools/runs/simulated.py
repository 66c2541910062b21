"""A twin in this process: what an experiment, a script or a notebook drives, as fast as the machine can."""

from collections.abc import Iterator
from contextlib import contextmanager

from lira.fusion.experts.tasks import TASKS, task_of
from lira.hal.profile import RobotProfile, load_profile
from lira.hal.safety.governed import SLICE_S, GovernedRobot
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.scenes.opening import Renderer
from lira.sim_backend.twin import Twin
from lira.sim_backend.world import World


class SimulatedRobot(GovernedRobot):
    """A twin behind its governor. `arena` is what a floor has not: a fresh start, and where the robot really is."""

    def __init__(self, twin: Twin, *, realtime: bool) -> None:
        """With `realtime` its time passes by itself."""
        super().__init__(twin)
        self.arena = twin
        self._realtime = realtime

    def _slice_s(self, now_s: float) -> float:
        """Up to the next time-out, where time passes only here: nobody does anything meanwhile, and no device fails."""
        if self._realtime:
            return SLICE_S
        with self._lock:
            return max(SLICE_S, self._governor.steady_until(now_s) - now_s)


@contextmanager
def simulate(
    world: str | World = "line-obstacles",
    profile: str | RobotProfile | None = None,
    *,
    layout: int = 0,
    seed: int = 0,
    renderer: Renderer = "auto",
    realtime_factor: float | None = None,
) -> Iterator[SimulatedRobot]:
    """Open a robot in a simulated world, and close it in the end.

    `world` and `profile` are names, paths of TOML files, or what was loaded; without a profile it is the robot of the
    thesis's experiment in that world. Time passes only while somebody drives, or by itself with `realtime_factor`.
    Raises `ConfigError` for a name that is none, or if pybullet is asked for and missing.
    """
    place = load_world(world) if isinstance(world, str) else world
    kind = TASKS[task_of(place.name)].profile if profile is None else profile
    body = load_profile(kind) if isinstance(kind, str) else kind
    twin = Twin(body, place, layout=layout, seed=seed, renderer=renderer, realtime_factor=realtime_factor)
    robot = SimulatedRobot(twin, realtime=realtime_factor is not None)
    try:
        robot.open()
        yield robot
    finally:
        robot.close()
