"""The novice Pi^N and its labels D^N: it acts and drops redundant labels; a network trains whenever m new are stored.

The other novice there is learns from every label at once: `fusion/learning/kernel_novice.py`.
"""

import math
import time
from abc import ABC, abstractmethod
from typing import Literal, Protocol

from lira.fusion.inference.architecture import Weights
from lira.fusion.inference.build import alone
from lira.fusion.inference.networks import DrivingNet
from lira.fusion.learning.labels import Label, is_rest
from lira.fusion.learning.learned_policy import LearnedPolicy, Together
from lira.fusion.preprocess import Features
from lira.hal.config import Table
from lira.hal.messages import Action, Driver
from lira.hal.profile import Base

CATCH_UP_POLL_S = 0.005
HAND_TURN_RAD_S = 1.1  # a hand turns a robot no faster, whatever the robot can do


class LearningSettings(Table, frozen=True):
    """How labels become a policy; fractions are of the action range.

    An *idle frame* is a step with the dead-man held and the stick at rest. As a label it teaches to stand, which is
    what was done; a person who only thinks for a moment may rather want it left out.
    """

    labels_per_step: int = 30  # m
    redundancy: float = 0.05  # L
    action_range: float = 2.0
    turn: float = 1.0  # the share of that range which is used in turns, see `used_turn`
    filter_human: bool = True  # False keeps every human label
    human_weight: float = 1.0  # of a human label's squared error
    idle_frames: Literal["label", "skip"] = "label"


class Trainer(Protocol):
    """Where training happens: in this process or in one of its own."""

    network: DrivingNet
    """Drives as the network does before any training."""

    def add(self, label: Label) -> None:
        """Hand over one label."""

    def start(self, now_s: float) -> None:
        """Begin one training step."""

    def poll(self, now_s: float) -> Weights | None:
        """Return new weights once they are there."""

    @property
    def pending(self) -> bool:
        """Whether a training step is under way."""

    def close(self) -> None:
        """End the trainer, in bounded time."""


def is_redundant(a: Action, a_n: Action, threshold: float, turn: float = 1.0) -> bool:
    """Whether the novice already does it: every |a_k - a^N_k| < L (section III-C), for the turn a share of L."""
    return abs(a[0] - a_n[0]) < threshold and abs(a[1] - a_n[1]) < threshold * turn


def used_turn(base: Base) -> float:
    """The share of its turns that a hand uses of a robot.

    Who could turn ten times as fast as anybody drives it would else leave its line for good before a label that sets it
    right counts as another action.
    """
    return min(1.0, HAND_TURN_RAD_S / base.max_angular_rad_s)


class Novice(LearnedPolicy, ABC):
    """The project's policy under training. It changes between two steps, never during one."""

    def __init__(self, settings: LearningSettings) -> None:
        self.settings = settings
        self.stored = 0
        self.training_steps = 0  # finished ones

    @abstractmethod
    def act(self, features: Features) -> Action:
        """a^N as it is now."""

    def knows(self, features: Features, share: float) -> bool:  # noqa: ARG002
        """Whether it is surer here than it was at all but that share of what a human had to show it; never if it
        cannot tell.
        """
        return False

    def doubts(self, features: Features) -> bool:  # noqa: ARG002
        """Whether it knows less here than where it was proven; never if it cannot tell."""
        return False

    @abstractmethod
    def remember(self, label: Label) -> None:
        """Take in a label: a new one, or one that an earlier session stored."""

    @abstractmethod
    def frozen(self) -> DrivingNet:
        """Return a copy of the policy as it drives alone, to be saved."""

    def learn(self, features: Features, action: Action, source: str, a_n: Action) -> bool:
        """Store a label unless it is redundant; `a_n` is the novice's own action there. Returns whether it was kept."""
        threshold, turn = self.settings.redundancy * self.settings.action_range, self.settings.turn
        keep_always = source == Driver.HUMAN and not self.settings.filter_human
        if not keep_always and is_redundant(action, a_n, threshold, turn):
            return False
        self.remember(Label(features, action, source, self.weight(source)))
        return True

    def leaves_out(self, human: Action) -> bool:
        """Whether the human's action is an idle frame that is to be no label."""
        return self.settings.idle_frames == "skip" and is_rest(human)

    def weight(self, source: str) -> float:
        """How much a label of this source counts."""
        return self.settings.human_weight if source == Driver.HUMAN else 1.0

    def catch_up(self) -> None:
        """Wait until everything that is due is learned."""


class NetworkNovice(Novice):
    """A network, trained beside the loop. Weights are swapped between two steps."""

    def __init__(self, network: DrivingNet, trainer: Trainer, settings: LearningSettings) -> None:
        super().__init__(settings)
        self.network = network
        self._trainer = trainer
        self._fresh = 0  # stored since the last training step that m labels brought began

    def act(self, features: Features) -> Action:
        """a^N of the current network."""
        return self.network.act(features)

    def together(self, *, proving: bool) -> Together:  # noqa: ARG002 - it does the same
        """The current network on several observations."""
        return self.network.act_all

    def remember(self, label: Label) -> None:
        """Hand a label to the trainer."""
        self._trainer.add(label)
        self.stored += 1
        self._fresh += 1

    def frozen(self) -> DrivingNet:
        """Copy the network, without an ensemble that only doubts."""
        return alone(self.network)

    def update(self, now_s: float) -> None:
        """Adopt weights that are ready; begin a training step if one is due: the remainder of m labels is carried."""
        weights = self._trainer.poll(now_s)
        if weights is not None:
            self.network.load_weights(weights)
            self.training_steps += 1
        if not self._trainer.pending and self._fresh >= self.settings.labels_per_step:
            self._fresh -= self.settings.labels_per_step
            self._trainer.start(now_s)

    def catch_up(self) -> None:
        """Run the training steps that are due, one after the other, and wait for them. The remainder is carried."""
        while self._trainer.pending or self._fresh >= self.settings.labels_per_step:
            self.update(math.inf)
            time.sleep(CATCH_UP_POLL_S if self._trainer.pending else 0.0)

    def close(self) -> None:
        """End the training, in bounded time."""
        self._trainer.close()
