"""What a way of teaching looks like to the control loop: it proposes before the robot moves and learns after."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, runtime_checkable

from lira.fusion.preprocess import Features
from lira.hal.messages import Action, ExpertView

Policy = Callable[[Features], Action]
"""A black box: anything that turns what the robot senses into an action."""

STAND: Action = (0.0, 0.0)


class Call(StrEnum):
    """How the human is called: to look, or to answer."""

    NONE = "none"
    ATTENTION = "attention"
    FEEDBACK = "feedback"


@dataclass(frozen=True, slots=True)
class Expert:
    """A named black box. `cruise` is its measured action where its sensor shows nothing to react to."""

    name: str
    act: Policy
    cruise: Action = (1.0, 0.0)


@dataclass(frozen=True, slots=True)
class Choice:
    """One row of the table of Algorithm 1: who drives, with which action, what is learned, how the human is called.

    `given` counts the times the human gave an expert the wheel; 0 where the driver has it by the method's own rules.
    """

    driver: str
    action: Action
    label: Action | None = None
    call: Call = Call.NONE
    given: int = 0


@dataclass(frozen=True, slots=True)
class Proposal:
    """What a method wants done on one observation as long as no human decides otherwise."""

    features: Features
    choice: Choice
    novice: Action = STAND
    experts: tuple[ExpertView, ...] = ()
    threshold: float = 0.0
    speed: float = 1.0
    relieves: bool = False  # a human who holds the wheel is asked to let go: who is proposed takes over

    @property
    def command(self) -> Action:
        """What the robot is told: both components times `speed`, so that the curvature is kept."""
        linear, angular = self.choice.action
        return linear * self.speed, angular * self.speed


@dataclass(frozen=True, slots=True)
class Settled:
    """What became of a label that was reserved."""

    proposal: Proposal
    stored: bool


@dataclass(frozen=True, slots=True)
class Lesson:
    """What became of a proposal: the choice once the human is known, and whether a label was stored.

    A label that is `reserved` is decided on later: it comes back among the `settled`.
    """

    choice: Choice
    stored: bool = False
    reserved: bool = False
    settled: tuple[Settled, ...] = ()


class Method(Protocol):
    """A way of driving and, perhaps, of learning."""

    def reset(self) -> None:
        """Forget what belongs to the past episode."""

    def update(self, now_s: float) -> None:
        """Adopt what training has brought by now."""

    def propose(self, features: Features) -> Proposal:
        """Decide as if no human were there."""

    def learn(self, proposal: Proposal, human: Action | None) -> Lesson:
        """Learn from what was executed; `human` is the human's action if the human drove."""

    def policy(self, driver: str) -> Policy:
        """Return the policy behind a driver's name, to look ahead with. Raises `KeyError` for "human"."""


@runtime_checkable
class Chooser(Protocol):
    """A method that a person may tell which expert shall drive: the answer to a call."""

    @property
    def offers(self) -> Mapping[str, Policy]:
        """Who can be given the wheel."""

    def choose(self, name: str) -> str | None:
        """Give the expert of that name the wheel. Returns why not, None if it drives from now on."""


@dataclass(frozen=True, slots=True)
class Alone:
    """A policy that drives by itself and learns nothing: an expert on show, or the novice's proving run."""

    name: str
    act: Policy

    def reset(self) -> None:
        """Nothing to forget."""

    def update(self, now_s: float) -> None:
        """Nothing to adopt."""

    def propose(self, features: Features) -> Proposal:
        """Propose the policy's own action."""
        action = self.act(features)
        return Proposal(features, Choice(self.name, action), novice=action)

    def learn(self, proposal: Proposal, human: Action | None) -> Lesson:
        """Learn nothing; the human may still take over."""
        return Lesson(proposal.choice if human is None else Choice("human", human))

    def policy(self, driver: str) -> Policy:  # noqa: ARG002 - whoever drives, it is this one
        """Return the one policy there is."""
        return self.act
