"""Looking ahead: what would happen from here. For scripted teachers and planners, never for policies."""

from collections.abc import Callable
from dataclasses import dataclass

import msgspec
import numpy as np

from lira.hal.bus.sensors import Stamped
from lira.hal.messages import Action, Command, CourseState, Twist
from lira.hal.profile import Field, RobotProfile
from lira.sim_backend import drive
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.course import Course, Obstacles, Place, footprint_radius_m
from lira.sim_backend.drive import Motion
from lira.sim_backend.layout import build
from lira.sim_backend.polyline import Floats
from lira.sim_backend.scenes.opening import Renderer, quickest
from lira.sim_backend.twin import Twin
from lira.sim_backend.world import World

# A box's corner can hide between two looks at the clearance that are farther apart than this.
LOOK_PERIOD_S = 0.1
# Boxes of which no part comes nearer than this to what can be reached are left out.
CARE_M = 2.0

Look = Callable[[str], Stamped]
"""Measures a sensor now, by its field of an observation."""


@dataclass(frozen=True, slots=True)
class Imagined:
    """Where N imagined robots are after each of T actions, arrays [N, T].

    `clearance_m` is the least since the action before, +inf where every box is too far away to matter.
    Without a line what is relative to it is nan.
    """

    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    clearance_m: Floats
    lateral_m: Floats
    progress_m: Floats
    heading_error_rad: Floats


class Foresight:
    """A second twin on the same floor, put where the first one is and let run ahead.

    `rollout` renders what the imagined robot looks at; `imagine` only moves it. Both use the twin's own drive model.
    """

    def __init__(
        self, profile: RobotProfile, world: str | World, layout: int = 0, *, renderer: Renderer | None = None
    ) -> None:
        self._profile = profile
        self._world = load_world(world) if isinstance(world, str) else world
        body = with_small_camera(profile)
        self._twin = Twin(body, self._world, layout=layout, renderer=renderer or quickest(self._world))
        self.set_layout(layout)

    def set_layout(self, layout: int) -> None:
        """Follow the first twin to another layout."""
        self.course = Course(build(self._world, layout), footprint_radius_m(self._profile.base))

    def rollout(
        self,
        state: CourseState,
        policy: Callable[[Look], Action],
        steps: int,
        period_s: float,
        ends: Callable[[CourseState], bool] = lambda _: False,
        first: Action | None = None,
    ) -> list[CourseState]:
        """Let `policy` drive from `state`: the state after each of `steps`.

        A policy gets a way to look, and only what it looks at is measured. The last state is a collision, a loss, or
        the first that `ends` it: what comes after is not looked at. `first` is what the policy does at `state`, if that
        is known: nothing is measured for it then.
        """
        twin, base = self._twin, self._profile.base
        twin.open()
        twin.place(self.course.layout.seed, state)
        states: list[CourseState] = []
        for _ in range(steps):
            linear, angular = policy(twin.sense) if first is None else first
            first = None
            twist = Twist(linear * base.max_linear_m_s, angular * base.max_angular_rad_s)
            twin.drive(Command(self._allowed_one(states[-1] if states else state, twist), twin.now()))
            twin.wait(twin.now() + period_s)
            states.append(twin.state())
            if states[-1].collided or states[-1].lost or ends(states[-1]):
                break
        return states

    def imagine(self, state: CourseState, actions: Floats, period_s: float) -> Imagined:
        """Drive N imagined robots from `state` by `actions` [N, T, 2], each held for `period_s`. Boxes do not block."""
        base = self._profile.base
        count, horizon, _ = actions.shape
        near = self.course.obstacles.near(state.x_m, state.y_m, base.max_linear_m_s * period_s * horizon + CARE_M)
        targets = np.clip(actions, -1.0, 1.0) * np.array([base.max_linear_m_s, base.max_angular_rad_s])
        looks = max(round(period_s / LOOK_PERIOD_S), 1)
        begin = spread(state, count)
        motion = self._follow(near, begin, np.repeat(targets, looks, axis=1), period_s / looks)
        there = drive.Motion(*(values[:, looks - 1 :: looks] for values in motion.arrays))
        place = self._places(begin, there, state.progress_m)
        distance = near.distance(motion.xy)
        clearance = distance.reshape(count, horizon, looks).min(-1) - self.course.radius_m
        relative = place.lateral_m, place.progress_m, place.heading_error_rad
        return Imagined(there.x_m, there.y_m, there.yaw_rad, clearance, *relative)

    def _follow(self, near: Obstacles, motion: Motion, targets: Floats, duration_s: float) -> Motion:
        """Drive robots [N] at velocities [N, K, 2], each held so long: arrays [N, K]."""
        base, field = self._profile.base, self._profile.field
        if field is None:
            return drive.path(base, motion, targets[:, :, 0], targets[:, :, 1], duration_s)
        moments = []
        for linear, angular in targets.transpose(1, 2, 0):
            motion = drive.step(base, motion, self._allowed(field, near, motion, linear), angular, duration_s)
            moments.append(motion)
        return drive.in_time(moments)

    def _places(self, begin: Motion, there: Motion, progress_m: float) -> Place:
        """Where robots are relative to the line [N, T], looked up each near where it was before; nan without a line."""
        if not self.course.has_line:
            return Place(*np.full((3, *there.x_m.shape), np.nan))
        place = self.course.place(begin.xy, begin.yaw_rad, progress_m)
        places = []
        for xy, yaw_rad in zip(there.xy.swapaxes(0, 1), there.yaw_rad.T, strict=True):
            place = self.course.place(xy, yaw_rad, place.progress_m)
            places.append((place.progress_m, place.lateral_m, place.heading_error_rad))
        return Place(*(np.stack(values, axis=-1) for values in zip(*places, strict=True)))

    def _allowed(self, field: Field, near: Obstacles, motion: Motion, linear_m_s: Floats) -> Floats:
        """The speed ahead that the protective field leaves, as `limit_speed` has it for one robot."""
        base = self._profile.base
        met_m = near.free_ahead(motion.x_m, motion.y_m, motion.yaw_rad, base.width_m / 2 + field.margin_m)
        free_m = met_m - base.length_m / 2
        slowed = np.where(free_m < field.slow_m, np.minimum(linear_m_s, field.slow_m_s), linear_m_s)
        return np.where(free_m < field.stop_m, 0.0, slowed)

    def _allowed_one(self, state: CourseState, wanted: Twist) -> Twist:
        """What the protective field leaves of a twist."""
        field = self._profile.field
        if field is None or wanted.linear_m_s <= 0.0:
            return wanted
        linear = self._allowed(field, self.course.obstacles, spread(state, 1), np.array([wanted.linear_m_s]))
        return Twist(float(linear[0]), wanted.angular_rad_s)

    def close(self) -> None:
        """Let go of the second twin. May be called twice."""
        self._twin.close()


def with_small_camera(profile: RobotProfile) -> RobotProfile:
    """Return the profile with a camera that draws no more than the networks see, without noise: it is only imagined."""
    camera, px = profile.camera, profile.features.image_px
    if camera.width_px * camera.height_px <= px * px:
        return profile
    small = msgspec.structs.replace(camera, width_px=px, height_px=px, encoding="png", noise_gray=0.0)
    return msgspec.structs.replace(profile, camera=small)


def spread(state: CourseState, count: int) -> Motion:
    """Make `count` robots in one state."""
    values = (state.x_m, state.y_m, state.yaw_rad, state.linear_m_s, state.angular_rad_s)
    return Motion(*(np.full(count, value) for value in values))
