"""The robot on its course: it moves, boxes block it, and a referee watches. Pure: the time is handed in."""

import math
from dataclasses import dataclass, replace

from lira.hal.messages import STOP, CourseState, Odometry, Twist
from lira.hal.profile import Base
from lira.sim_backend import drive
from lira.sim_backend.course import Course

# The referee looks at least this often, and every centimetre or so where a box may be touched.
REFEREE_PERIOD_S = 0.2
TOUCH_PERIOD_S = 0.01
STILL_M_S = 1e-3
ROUNDING_S = 1e-9


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the referee knows of the present episode, which is of a lap that began at `began_m`."""

    began_m: float
    progress_m: float
    lateral_m: float
    clearance_m: float
    collided: bool = False
    lost: bool = False
    finished: bool = False


class Body:
    """One robot on one course. `time_s` is how far its motion has been worked out.

    Where the boxes are is looked up only when one might have been reached since, or somebody asks; `_free_m` is how far
    at least the robot could go from where it is before it touches one.
    """

    def __init__(self, base: Base, course: Course) -> None:
        self._base = base
        self.course = course
        self.time_s = 0.0
        self._free_m = 0.0
        self._touched = False  # since the referee looked last
        self._judged, self._judged_s = False, 0.0  # whether that was now, and when
        self.put_down(0.0, 0.0, 0.0)

    def put_down(self, start_m: float, lateral_m: float, yaw_rad: float, began_m: float | None = None) -> None:
        """Start an episode at rest, at a place relative to the course, in a lap that begins there or at `began_m`."""
        self.motion = drive.motion(*self.course.start_pose(start_m, lateral_m, yaw_rad))
        self.odometry = drive.motion(0.0, 0.0, 0.0)
        self.command(STOP)
        self._verdict = Verdict(start_m if began_m is None else began_m, start_m, lateral_m, math.inf)
        self._look()

    def place(self, state: CourseState) -> None:
        """Continue from a state that a twin told: pose, velocity, progress; nothing has gone wrong yet."""
        self.motion = drive.motion(state.x_m, state.y_m, state.yaw_rad, state.linear_m_s, state.angular_rad_s)
        self.odometry = drive.motion(0.0, 0.0, 0.0)
        self.command(Twist(state.linear_m_s, state.angular_rad_s))
        progress_m = self._progress_m(None if math.isnan(state.progress_m) else state.progress_m)
        self._verdict = Verdict(progress_m, progress_m, 0.0, math.inf)
        self._look()

    def command(self, target: Twist) -> None:
        """Set the velocity to drive at from now on."""
        self._target = target
        self._commanded_s = self.time_s

    def advance(self, until_s: float) -> None:
        """Work the motion out until `until_s`."""
        while (left_s := until_s - self.time_s) > ROUNDING_S:
            self._move(min(left_s, REFEREE_PERIOD_S))
            if self.time_s - self._judged_s > REFEREE_PERIOD_S - ROUNDING_S:
                self._judge()
        self.time_s = max(self.time_s, until_s)

    @property
    def verdict(self) -> Verdict:
        """What the referee sees now."""
        if not self._judged:
            self._judge()
        return self._verdict

    def state(self) -> CourseState:
        """Ground truth at `time_s`."""
        motion, verdict, has_line = self.motion, self.verdict, self.course.has_line
        return CourseState(
            stamp_s=self.time_s,
            x_m=float(motion.x_m),
            y_m=float(motion.y_m),
            yaw_rad=math.remainder(float(motion.yaw_rad), math.tau),
            linear_m_s=float(motion.linear_m_s),
            angular_rad_s=float(motion.angular_rad_s),
            progress_m=verdict.progress_m if has_line else math.nan,
            lateral_m=verdict.lateral_m if has_line else math.nan,
            clearance_m=verdict.clearance_m,
            collided=verdict.collided,
            lost=verdict.lost,
            finished=verdict.finished,
        )

    def measured(self) -> Odometry:
        """What the wheels' encoders make of the motion since the start of the episode."""
        odometry = self.odometry
        return Odometry(
            stamp_s=self.time_s,
            x_m=float(odometry.x_m),
            y_m=float(odometry.y_m),
            yaw_rad=math.remainder(float(odometry.yaw_rad), math.tau),
            linear_m_s=float(odometry.linear_m_s),
            angular_rad_s=float(odometry.angular_rad_s),
        )

    def _move(self, duration_s: float) -> None:
        """Move in steps that cannot jump into a box."""
        until_s = self.time_s + duration_s
        while (left_s := until_s - self.time_s) > ROUNDING_S:
            speed_m_s = max(abs(float(self.motion.linear_m_s)), abs(self._target.linear_m_s))
            target, holds_s = self._obeyed()
            step_s = min(left_s, holds_s)
            if speed_m_s * step_s >= self._free_m:
                self._free_m = self._clearance_m()
                if speed_m_s * step_s >= self._free_m:
                    self._creep(target, speed_m_s, step_s)
                    continue
            self._step(target, step_s)
            self._free_m -= speed_m_s * step_s
        self._judged = False

    def _creep(self, target: Twist, speed_m_s: float, step_s: float) -> None:
        """Move as far as to the nearest box at most, or into it by a step that is small."""
        before, clearance_m = self.motion, self._free_m
        step_s = min(step_s, max(clearance_m / max(speed_m_s, STILL_M_S), TOUCH_PERIOD_S))
        odometry = self.odometry
        self._step(target, step_s)
        ahead_m = self._clearance_m()
        if ahead_m < 0.0 and ahead_m < clearance_m:
            # A disc that touches can turn, and back away, but not go on.
            self._touched = True
            after = replace(self.motion, x_m=before.x_m, y_m=before.y_m, linear_m_s=drive.number(0.0))
            self.motion, self.odometry = after, drive.reckon(self._base, odometry, before, after, step_s)
        else:
            self._free_m = ahead_m

    def _step(self, target: Twist, step_s: float) -> None:
        before = self.motion
        goal = drive.number(target.linear_m_s), drive.number(target.angular_rad_s)
        self.motion = drive.step(self._base, before, *goal, step_s)
        self.odometry = drive.reckon(self._base, self.odometry, before, self.motion, step_s)
        self.time_s += step_s

    def _obeyed(self) -> tuple[Twist, float]:
        """What the base drives at, and for how long: its firmware gives up on a commander that has gone silent."""
        if self._base.drive != "wheels":
            return self._target, math.inf
        holds_s = self._commanded_s + drive.FIRMWARE_WATCHDOG_S - self.time_s
        return (self._target, holds_s) if holds_s > ROUNDING_S else (STOP, math.inf)

    def _clearance_m(self) -> float:
        return self.course.clearance_one(float(self.motion.x_m), float(self.motion.y_m))

    def _look(self) -> None:
        """First verdict of an episode. Who is put down into a box has collided."""
        self._touched = self._clearance_m() < 0.0
        self._judge()

    def _progress_m(self, hint_m: float | None) -> float:
        motion, curve = self.motion, self.course.layout.curve
        if hint_m is not None:
            return curve.project_one(float(motion.x_m), float(motion.y_m), hint_m)[0]
        return float(curve.project(motion.xy)[0])

    def _judge(self) -> None:
        """Let the referee look."""
        course, was = self.course, self._verdict
        curve = course.layout.curve
        progress_m, lateral_m = curve.project_one(float(self.motion.x_m), float(self.motion.y_m), was.progress_m)
        clearance_m = self._free_m = self._clearance_m()
        self._verdict = Verdict(
            began_m=was.began_m,
            progress_m=progress_m,
            lateral_m=lateral_m,
            clearance_m=clearance_m,
            collided=was.collided or self._touched,
            lost=was.lost or course.lost(lateral_m, clearance_m),
            finished=was.finished or course.finished(progress_m, was.began_m),
        )
        self._judged, self._judged_s, self._touched = True, self.time_s, False
