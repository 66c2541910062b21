"""What a method teaches, seen from outside: a policy that takes labels and, now and then, becomes a better one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from lira.fusion.learning.labels import Label
from lira.fusion.preprocess import Features
from lira.hal.messages import Action

if TYPE_CHECKING:
    from lira.fusion.inference.networks import DrivingNet

Together = Callable[[Sequence[Features]], list[Action]]
"""A policy on what several robots see at one time. It does as it would on each, but for rounding."""


@dataclass(frozen=True, slots=True)
class Part:
    """A label's part in an action: all labels' `share` together are it, before it is clipped.

    `number` counts the labels in the order in which they were learned, from 0; `action` is what the label says, and
    `likeness` in [0, 1] how much what was seen then, or its mirror image, is like what is seen now.
    """

    number: int
    source: str
    action: Action
    share: Action
    likeness: float


@dataclass(frozen=True, slots=True)
class Contradiction:
    """A label that is not followed, since the others say otherwise of what was seen there: `others`.

    `mirrored`: it is followed itself; left and right exchanged it is not.
    """

    number: int
    source: str
    action: Action
    others: Action
    mirrored: bool = False


class LearnedPolicy:
    """A policy under training. The project's is `Novice`; one of your own defines `act` and `remember`.

    `stored` counts its labels and `training_steps` how often it has learned from them: before the first time it is not
    asked to prove itself.
    """

    stored: int = 0
    training_steps: int = 0

    @property
    def trained(self) -> bool:
        """Whether it has learned anything."""
        return self.training_steps > 0

    def act(self, features: Features) -> Action:  # noqa: ARG002 - for those who look
        """What it does now, in [-1, 1]^2."""
        return 0.0, 0.0

    def alone(self, features: Features) -> Action:
        """What it does when nobody teaches it any more: the same, unless it knows how it errs."""
        return self.act(features)

    def proving(self, features: Features) -> Action:
        """The same in a run that proves it, from which it may learn what it knows."""
        return self.alone(features)

    def together(self, *, proving: bool) -> Together | None:  # noqa: ARG002
        """Return what it does alone on what several robots see, as `proving` or as `alone`.

        None where it has to be asked by one robot after the other, as one that remembers what it saw.
        """
        return None

    def remember(self, label: Label) -> None:  # noqa: ARG002
        """Take in a label."""
        self.stored += 1

    def learn(self, features: Features, action: Action, source: str, a_n: Action) -> bool:  # noqa: ARG002
        """Take in a label unless it tells nothing new; `a_n` is its own action there. Returns whether it was kept."""
        self.remember(Label(features, action, source, self.weight(source)))
        return True

    def leaves_out(self, human: Action) -> bool:  # noqa: ARG002
        """Whether the human's action is to be no label."""
        return False

    def weight(self, source: str) -> float:  # noqa: ARG002
        """How much a label of this source counts."""
        return 1.0

    def set_aside(self) -> list[Contradiction]:
        """Labels it does not believe; none, unless it can tell."""
        return []

    def explain(self, features: Features) -> list[Part]:  # noqa: ARG002 - for those who can
        """Which labels make what it does here, the largest part first; none, unless it can tell."""
        return []

    def frozen(self) -> "DrivingNet | None":
        """Return a copy of the policy as it drives alone, to be saved; None if it is no network."""
        return None

    def update(self, now_s: float) -> None:
        """Train if it is time to, and adopt what training has brought; called before every decision."""

    def close(self) -> None:
        """End the training, in bounded time."""


UNTAUGHT = LearnedPolicy()
"""Nobody: the policy of a method that teaches none."""
