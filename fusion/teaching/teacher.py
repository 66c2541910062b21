"""The scripted teacher: stands in for the person with the gamepad, faults included.

It sees the simulator's state, looks ahead with the policy that is driving, takes over before a collision, a lost line,
a drive the wrong way or a standstill, and hands back once that policy has looked safe for a few steps. When called it
reacts sooner.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Literal, TypeVar

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from lira.fusion.learning.novice import HAND_TURN_RAD_S
from lira.fusion.methods.base import Policy, Proposal
from lira.fusion.preprocess import Features, Look, Preprocessor
from lira.fusion.teaching.foresight import Foresight
from lira.fusion.teaching.planner import COMFORT_M, Planner
from lira.hal.config import Table
from lira.hal.messages import Action, Call, CourseState
from lira.hal.profile import RobotProfile

Lengths = TypeVar("Lengths", float, NDArray[np.float64])
Share = Annotated[float, Meta(ge=0.0, le=1.0)]


class TeacherSettings(Table, frozen=True):
    """The teacher's skill. The defaults are a skilled human's faults (all assumed); see `PERFECT` and `UNSKILLED`."""

    style: Literal["bang-bang", "proportional"] = "bang-bang"
    horizon_s: float = 1.5
    margin_m: float = 0.08  # closer than this to a box is danger
    lateral_m: float = 1.0  # further than this from the line is danger
    stray_m: float = 0.45  # and so is this where no box is within `free_m`: there is nothing to drive around
    free_m: float = 1.0
    back: Share = 0.13  # and so is to get so far back along the line, as a share of what full speed drives meanwhile
    follow_line: bool = True  # False: only the boxes matter, and to go straight on where there is none
    stall: Share = 0.3  # a policy that drives less than this share of full speed over the horizon stands in the way
    wander_rad: float = 0.1  # a larger turn within the horizon, without a box in the way, is wrong then
    safe_steps: int = 3
    longest_s: float = 20.0  # after so long in control a hand gives up: whatever it does there does not help
    turn_rad_s: float = HAND_TURN_RAD_S
    delay_s: float = 0.6  # median of the log-normal reaction delay
    called_delay_s: float = 0.35
    delay_sigma: float = 0.3
    gain_sigma: float = 0.15  # over- and understeer, log-normal, per intervention
    wrong_direction: Share = 0.05
    missed: Share = 0.02
    notices_s: float = 3.0  # a danger that was missed is seen so much later, if it lasts: a robot that stands and asks


SLOWED = 0.5  # of the speed that was foreseen: a robot that is slower is being slowed down
SLOWED_S = 1.0  # longer than that takes to where a step would have led: a robot that is not there by then stands
AS_FORESEEN = 1e-6  # metres, radians and so on: a robot that is so near to where it was foreseen is there
NOBODY: Mapping[str, Policy] = MappingProxyType({})

SKILLED = TeacherSettings()
PERFECT = TeacherSettings(delay_s=0.0, called_delay_s=0.0, gain_sigma=0.0, wrong_direction=0.0, missed=0.0)
UNSKILLED = TeacherSettings(delay_s=1.0, called_delay_s=0.6, gain_sigma=0.4, wrong_direction=0.15, missed=0.1)
TEACHERS = {"scripted": SKILLED, "perfect": PERFECT, "unskilled": UNSKILLED}


@dataclass(frozen=True, slots=True)
class Outlook:
    """How a policy was foreseen to drive from where it `began`, state after state."""

    policy: Policy
    began: CourseState
    drive: list[CourseState]

    def came_true(self, state: CourseState, policy: Policy) -> bool:
        """Whether its first state has come true and the same policy is to drive on, none the wiser."""
        return policy == self.policy and _same_place(state, self.drive[0])

    def still_holds(self, state: CourseState, policy: Policy) -> bool:
        """Whether the same policy was slowed down, and is not as far yet as it was foreseen to be a step later."""
        first = self.drive[0]
        slow = abs(state.linear_m_s) < SLOWED * abs(first.linear_m_s)
        soon = state.stamp_s < self.began.stamp_s + SLOWED_S
        return slow and soon and policy == self.policy and _gap_m(self.began, state) < _gap_m(self.began, first)


def _gap_m(one: CourseState, other: CourseState) -> float:
    return math.hypot(one.x_m - other.x_m, one.y_m - other.y_m)


def _same_place(one: CourseState, other: CourseState) -> bool:
    """Whether a robot stands and moves in both states alike, but for rounding."""
    gaps = (
        *(one.x_m - other.x_m, one.y_m - other.y_m, math.remainder(one.yaw_rad - other.yaw_rad, math.tau)),
        *(one.linear_m_s - other.linear_m_s, one.angular_rad_s - other.angular_rad_s),
        0.0 if math.isnan(one.progress_m) else one.progress_m - other.progress_m,
    )
    return max(map(abs, gaps)) < AS_FORESEEN


class ScriptedTeacher:
    """Watches, takes over when it must, drives, and hands back."""

    def __init__(self, foresight: Foresight, profile: RobotProfile, settings: TeacherSettings, seed: int) -> None:
        self._foresight = foresight
        self._settings = settings
        self._period_s = profile.period_s
        self._full_speed_m_s = profile.base.max_linear_m_s
        self._steps = math.ceil(settings.horizon_s / profile.period_s)
        self._preprocess = Preprocessor(profile)
        self._steer = min(1.0, settings.turn_rad_s / profile.base.max_angular_rad_s)
        self._planner = Planner(
            foresight, settings.style, profile.period_s, follow_line=settings.follow_line, steer=self._steer
        )
        self._random = np.random.default_rng(seed)
        self._hands_off()

    def reset(self, layout: int) -> None:
        """A new episode: a look at the layout, hands off, nothing seen yet."""
        self._foresight.set_layout(layout)
        self._hands_off()

    def close(self) -> None:
        """Let go of the foresight."""
        self._foresight.close()

    def _hands_off(self) -> None:
        self._driving = False
        self._react_at_s: float | None = None  # when a danger that was seen will be answered
        self._safe = 0
        self._took_over_s = -math.inf
        self._gain, self._wrong_steps = 1.0, 0
        self._outlook: Outlook | None = None
        self._planner.reset()

    def act(
        self, state: CourseState, proposal: Proposal, policy: Policy | None, offers: Mapping[str, Policy] = NOBODY
    ) -> Action | str | None:
        """Return the action while it has control, once the name of an expert that shall have it, else None."""
        if policy is None:
            return self._planner.plan(state)  # the initial demonstration: careful and without faults
        danger = self._danger(state, proposal, policy)
        if self._driving:
            self._safe = 0 if danger else self._safe + 1
            gives_up = state.stamp_s >= self._took_over_s + self._settings.longest_s
            self._driving = self._safe < self._settings.safe_steps and not proposal.relieves and not gives_up
        elif self._reacts(state.stamp_s, danger, alert=_asks(proposal)):
            name = self._pick(state, proposal.features, offers)
            if name is not None:
                self._react_at_s = None
                return name
            self._take_over(state.stamp_s)
        if not self._driving:
            return None
        return self._with_faults(self._planner.plan(state))

    def _pick(self, state: CourseState, seen: Features, offers: Mapping[str, Policy]) -> str | None:
        """An expert that does well from here on, if one can be given control; at times a wrong one."""
        if not offers:
            return None
        if self._random.random() < self._settings.wrong_direction:
            return list(offers)[int(self._random.integers(len(offers)))]
        for name, policy in offers.items():
            if not self._goes_wrong(state, self._foresee(state, seen, policy, self._steps)):
                return name
        return None

    def _danger(self, state: CourseState, proposal: Proposal, policy: Policy) -> bool:
        """Whether the policy goes wrong; it does not where no policy could."""
        outlook = self._look_ahead(state, proposal.features, policy)
        if not self._goes_wrong(outlook.began, outlook.drive):
            return False
        slow = proposal.choice.action[0] < self._settings.stall
        return not self._settings.follow_line or slow or self._within_reach(state)

    def _look_ahead(self, state: CourseState, seen: Features, policy: Policy) -> Outlook:
        """Foresee what the policy would do at full speed, beginning with what was foreseen before if it has come true.

        A robot that was slowed down is on its way there: it is looked at anew where it would have decided anew.
        """
        drive: list[CourseState] = []
        if self._outlook is not None and self._outlook.came_true(state, policy):
            drive = self._outlook.drive[1:]
        elif self._outlook is not None and not self._driving and self._outlook.still_holds(state, policy):
            return self._outlook
        missing = self._steps - len(drive)
        if not drive:
            drive = self._foresee(state, seen, policy, missing)
        elif not self._ends(drive[-1]):
            drive += self._foresee(drive[-1], None, policy, missing)
        self._outlook = Outlook(policy, state, drive)
        return self._outlook

    def _foresee(self, state: CourseState, seen: Features | None, policy: Policy, steps: int) -> list[CourseState]:
        """Let the policy drive in the second twin; `seen` is what is seen at `state`, where the robot is there."""
        first = None if seen is None else policy(seen)
        return self._foresight.rollout(state, self._seeing(policy), steps, self._period_s, self._unsafe, first)

    def _ends(self, state: CourseState) -> bool:
        """Whether nothing is foreseen after a state."""
        return state.lost or self._unsafe(state)

    def _goes_wrong(self, state: CourseState, drive: list[CourseState]) -> bool:
        """Whether a drive from `state` hits something, loses the line, turns back or stands, at its full speed."""
        if self._unsafe(drive[-1]):
            return True
        aimless = self._turns_back(state, drive) if self._settings.follow_line else self._wanders(state, drive)
        return aimless or self._stalls(state, drive)

    def _unsafe(self, state: CourseState) -> bool:
        """Whether it is too near to a box or too far from the line: what comes after it changes nothing."""
        off = self._off_line(state.lateral_m, state.clearance_m)
        return state.collided or state.clearance_m < self._settings.margin_m or bool(off)

    def _turns_back(self, state: CourseState, drive: list[CourseState]) -> bool:
        """Whether the policy drives along the line the wrong way; never where there is no line."""
        return drive[-1].progress_m < state.progress_m - self._settings.back * self._full_speed_m(self._steps)

    def _stalls(self, state: CourseState, drive: list[CourseState]) -> bool:
        driven_m = sum(map(_gap_m, (state, *drive[:-1]), drive))
        return driven_m < self._settings.stall * self._full_speed_m(len(drive))

    def _full_speed_m(self, steps: int) -> float:
        """How far the robot gets at most within some steps."""
        return self._full_speed_m_s * self._period_s * steps

    def _wanders(self, state: CourseState, drive: list[CourseState]) -> bool:
        """Whether the policy turns although the way straight ahead is free."""
        straight = np.zeros((1, self._steps, 2))
        straight[:, :, 0] = 1.0
        free = self._foresight.imagine(state, straight, self._period_s).clearance_m.min() > COMFORT_M
        turned = math.remainder(drive[-1].yaw_rad - state.yaw_rad, math.tau)
        return bool(free and abs(turned) > self._settings.wander_rad)

    def _within_reach(self, state: CourseState) -> bool:
        """Whether any steering at all could end badly. Saves looking ahead with rendered sensors where none can."""
        turns = np.linspace(-1.0, 1.0, 9) * self._steer
        actions = np.zeros((turns.size, self._steps, 2))
        actions[:, :, 0] = 1.0
        actions[:, :, 1] = turns[:, None]
        futures = self._foresight.imagine(state, actions, self._period_s)
        close = futures.clearance_m < self._settings.margin_m + 0.1
        far = self._off_line(futures.lateral_m, futures.clearance_m)
        back = np.abs(futures.heading_error_rad[:, 0]) > math.pi / 2
        return bool(close.any() or np.any(far) or back.any())

    def _off_line(self, lateral_m: Lengths, clearance_m: Lengths) -> NDArray[np.bool_] | bool:
        """Whether it is too far from the line, one robot or many."""
        settings, off_m = self._settings, abs(lateral_m)
        strayed = (off_m > settings.stray_m) & (clearance_m > settings.free_m)
        return settings.follow_line & ((off_m > settings.lateral_m) | strayed)

    def _seeing(self, policy: Policy) -> Callable[[Look], Action]:
        return lambda look: policy(self._preprocess.looking(look))

    def _reacts(self, now_s: float, danger: bool, *, alert: bool) -> bool:
        """Whether the hand moves now: a danger has lasted for as long as it takes to react to it."""
        if not danger:
            self._react_at_s = None
            return False
        if self._react_at_s is None:
            median = self._settings.called_delay_s if alert else self._settings.delay_s
            missed = self._random.random() < self._settings.missed
            delay = median * math.exp(self._settings.delay_sigma * self._random.standard_normal())
            self._react_at_s = now_s + delay + missed * self._settings.notices_s
        return now_s >= self._react_at_s - 1e-9

    def _take_over(self, now_s: float) -> None:
        self._driving, self._safe, self._react_at_s = True, 0, None
        self._took_over_s = now_s
        self._gain = math.exp(self._settings.gain_sigma * self._random.standard_normal())
        self._wrong_steps = 2 if self._random.random() < self._settings.wrong_direction else 0
        self._planner.reset()

    def _with_faults(self, action: Action) -> Action:
        linear, angular = action
        if self._wrong_steps:
            self._wrong_steps -= 1
            angular = -angular
        return linear, max(-1.0, min(1.0, angular * self._gain))


def _asks(proposal: Proposal) -> bool:
    """Whether there is a reason to watch closely: a call, or an expert that was just given control."""
    return proposal.choice.call is not Call.NONE or proposal.choice.given > 0
