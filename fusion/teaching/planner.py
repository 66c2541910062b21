"""How the scripted teacher finds its way: it tries short steering sequences in its head and takes the best one."""

from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lira.fusion.teaching.foresight import Foresight, Futures
from lira.hal.messages import Action, CourseState

Style = Literal["bang-bang", "proportional"]

# A plan is a few stages of constant steering, in steps of 0.2 s (5 Hz).
STAGES_S = (0.4, 0.6, 0.8, 0.8)
STEERING: dict[Style, tuple[float, ...]] = {"bang-bang": (-1.0, 0.0, 1.0), "proportional": (-1.0, -0.5, 0.0, 0.5, 1.0)}
COMFORT_M = 0.40  # clearance below which closeness costs
STAY_COST = 0.05  # of turning otherwise than the last plan: a small one lets full steer settle on the line
SPOT_STAY_COST = 1.0  # the same on the spot: who turns to and fro there never gets away
TOUCH_M = 0.03
STILL_M = 0.005  # within a step: it stands
ASKEW_RAD = 1.0  # from here on the robot may be driving the line the wrong way, and progress lost costs
RETREAT_COST = 3.0  # of each metre: more than to turn round, on the spot or beside the line


class Planner:
    """Random-free sampling planner over a fixed set of action sequences [N, T, 2], which steer up to `steer`."""

    def __init__(
        self, foresight: Foresight, style: Style, period_s: float, *, follow_line: bool, steer: float = 1.0
    ) -> None:
        self._foresight = foresight
        self._period_s = period_s
        self._style = style
        self._follow = float(follow_line)
        self._sequences = action_sequences(style, period_s) * (1.0, steer)
        self._effort = np.abs(self._sequences[:, :, 1]).mean(axis=1)
        self.reset()

    def reset(self) -> None:
        """Forget the last plan."""
        self._last: Action | None = None

    def plan(self, state: CourseState) -> Action:
        """Return the first action of the best sequence from `state`."""
        cost = self._cost(state)
        if self._last is not None:  # stay with a plan unless another is clearly better: labels with one mind
            to_and_fro = (self._sequences[:, 0, 0] == 0.0) & (self._last[0] == 0.0)
            cost = cost + np.where(to_and_fro, SPOT_STAY_COST, STAY_COST) * np.abs(
                self._sequences[:, 0, 1] - self._last[1]
            )
        linear, angular = self._sequences[int(np.argmin(cost)), 0]
        if self._style == "proportional":
            angular = self._blend(cost)
        self._last = float(linear), float(angular)
        return self._last

    def _cost(self, state: CourseState) -> NDArray[np.float64]:
        futures = self._foresight.imagine(state, self._sequences, self._period_s)
        steps = self._sequences.shape[1]
        touch_m = min(TOUCH_M, 0.5 * max(state.clearance_m, 0.0))  # already close: look for the way out
        hit = futures.clearance_m < touch_m
        first_hit = np.where(hit.any(axis=1), hit.argmax(axis=1), steps)
        closeness = np.clip(1.0 - futures.clearance_m / COMFORT_M, 0.0, 1.0)
        lateral = np.nan_to_num(np.abs(futures.lateral_m))
        heading = np.nan_to_num(np.abs(futures.heading_error_rad[:, -1]))
        cost: NDArray[np.float64] = (
            100.0 * (1.0 - first_hit / steps)
            + 3.0 * (closeness**2).mean(axis=1)
            + self._follow * (3.0 * (lateral**2).mean(axis=1) + 0.2 * lateral[:, -1] + 0.3 * heading)
            + self._follow * RETREAT_COST * _retreat_m(futures, state)
            + 0.15 * self._effort
            + 8.0 * _standing(futures, state)
        )
        return cost

    def _blend(self, cost: NDArray[np.float64]) -> float:
        """A proportional hand steers between the best plans to one side instead of jumping from one to another."""
        turns = self._sequences[:, 0, 1]
        side = np.sign(turns[int(np.argmin(cost))])
        weight = np.exp(-(cost - cost.min()) / 0.05) * (turns * side >= 0.0)
        return float(np.average(turns, weights=weight))


def _standing(futures: Futures, state: CourseState) -> NDArray[np.float64]:
    """Share of its time that the robot stands in each future, [N]: as planned, or held by its protective field."""
    x_m = np.diff(futures.x_m, axis=1, prepend=state.x_m)
    y_m = np.diff(futures.y_m, axis=1, prepend=state.y_m)
    still: NDArray[np.float64] = (np.hypot(x_m, y_m) < STILL_M).mean(axis=1)
    return still


def _retreat_m(futures: Futures, state: CourseState) -> NDArray[np.float64]:
    """Progress that each future loses, [N], where the robot is askew: else to swing out around a box would cost.

    Without it a plan that goes on the wrong way looks better than one that turns round: the end of neither faces along
    the line, and the turn leaves it.
    """
    if not np.abs(futures.heading_error_rad[:, 0]).min() > ASKEW_RAD:
        return np.zeros(len(futures.progress_m))
    return np.maximum(state.progress_m - futures.progress_m[:, -1], 0.0)


def action_sequences(style: Style, period_s: float) -> NDArray[np.float64]:
    """All steering sequences of a style at full speed, and those that first turn on the spot: [N, T, 2]."""
    counts = [max(1, round(stage / period_s)) for stage in STAGES_S]
    rows = [(1.0, turns) for turns in product(STEERING[style], repeat=len(counts))]
    rows += [(0.0, turns) for turns in product((-1.0, 1.0), *[STEERING["bang-bang"]] * (len(counts) - 1))]
    sequences = np.zeros((len(rows), sum(counts), 2))
    for sequence, (first, turns) in zip(sequences, rows, strict=True):
        sequence[:, 0] = 1.0
        sequence[: counts[0], 0] = first
        sequence[:, 1] = np.repeat(turns, counts)
    return sequences
