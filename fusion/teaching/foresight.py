"""What a teacher needs to look ahead: a second twin to try things in, without touching the first."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lira.fusion.preprocess import Look
from lira.hal.messages import Action, CourseState


class Futures(Protocol):
    """Imagined drives, each array [N, T]; what a world has no line for is nan."""

    @property
    def x_m(self) -> NDArray[np.float64]:
        """Where the robot is, in the frame of its `CourseState`."""

    @property
    def y_m(self) -> NDArray[np.float64]:
        """The same, to the left."""

    @property
    def clearance_m(self) -> NDArray[np.float64]:
        """Distance to the nearest box."""

    @property
    def lateral_m(self) -> NDArray[np.float64]:
        """Distance left of the line."""

    @property
    def progress_m(self) -> NDArray[np.float64]:
        """Distance along the line."""

    @property
    def heading_error_rad(self) -> NDArray[np.float64]:
        """Yaw relative to the line."""


class Foresight(Protocol):
    """A second twin to try things in."""

    def set_layout(self, layout: int) -> None:
        """Arrange the boxes as they stand in the episode that begins."""

    def close(self) -> None:
        """Let go of the second twin."""

    def rollout(
        self,
        state: CourseState,
        policy: Callable[[Look], Action],
        steps: int,
        period_s: float,
        ends: Callable[[CourseState], bool],
        first: Action | None = None,
    ) -> list[CourseState]:
        """Let a policy drive from `state`, with rendered sensors; ends early at a collision, lost line, or as told.

        A policy gets a way to look. `first` is what it does there, if that is known already.
        """

    def imagine(self, state: CourseState, actions: NDArray[np.float64], period_s: float) -> Futures:
        """Follow action sequences [N, T, 2] from `state`, without sensors."""
