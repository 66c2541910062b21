"""What becomes of a lap on a twin after each step. Pure."""

from enum import Enum

import numpy as np

from lira.fusion.control import Step
from lira.fusion.teaching.ride import BLIND_M, Tally
from lira.hal.messages import Call, CourseState, Driver, Phase


class Fate(Enum):
    """How a lap goes on."""

    GOES_ON = 0
    PUT_BACK = 1  # after a crash in training
    OVER = 2


def count(step: Step, tally: Tally, phase: Phase) -> None:
    """Count a step."""
    tally.steps += 1
    tally.human_steps += step.lesson.choice.driver == Driver.HUMAN
    tally.stops += phase != Phase.TRAIN and step.proposal.choice.call is Call.FEEDBACK


def is_helped(step: Step | None, phase: Phase) -> bool:
    """Whether a hand took over what the novice has to do alone."""
    return phase != Phase.TRAIN and step is not None and step.lesson.choice.driver == Driver.HUMAN


def fate(state: CourseState, tally: Tally, phase: Phase, *, blind: bool, late: bool) -> Fate:
    """Judge a lap by where the robot is, and count what happened. `blind`: its sensors show nothing."""
    if np.isfinite(state.lateral_m) and not blind:
        tally.lateral_m.append(state.lateral_m)
    collided = state.collided or (blind and state.clearance_m < BLIND_M)
    if collided or state.lost:
        tally.collisions += collided
        tally.lost += state.lost
        return Fate.PUT_BACK if phase == Phase.TRAIN else Fate.OVER
    if state.finished:
        return Fate.OVER
    if phase != Phase.TRAIN and late:
        tally.unfinished += 1
        return Fate.OVER
    return Fate.GOES_ON
