"""What a way of teaching looks like to the control loop: it proposes before the robot moves and learns after."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from lira.fusion.learning.labels import Label
from lira.fusion.learning.learned_policy import UNTAUGHT, LearnedPolicy, Together
from lira.fusion.preprocess import Features
from lira.hal.messages import Action, Call, Driver, ExpertView, Phase

Policy = Callable[[Features], Action]
"""A black box: anything that turns what the robot senses into an action."""

STAND: Action = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class AsTaught:
    """What a policy under training does now; equal to what it does at another moment if it has learned nothing since.

    `training_steps` is how often it had learned.
    """

    act: Policy
    training_steps: int

    def __call__(self, features: Features) -> Action:
        """Act on what is seen."""
        return self.act(features)


@dataclass(frozen=True, slots=True)
class Expert:
    """A named black box. `cruise` is its measured action where its sensor shows nothing to react to."""

    name: str
    act: Policy
    cruise: Action = (1.0, 0.0)


@dataclass(frozen=True, slots=True)
class Choice:
    """One row of the table of Algorithm 1: who drives, with which action, what is learned, how the human is called.

    `driver` is a `Driver`, or the name of an expert or of whatever else a method lets drive.
    `given` counts the times the human gave an expert control; 0 where the driver has it by the method's own rules.
    """

    driver: str
    action: Action
    label: Action | None = None
    call: Call = Call.NONE
    given: int = 0


ASK = Choice(Driver.NOBODY, STAND, call=Call.FEEDBACK)
"""Stand, and ask the human to drive: who knows nothing yet."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """What a method wants done on one observation as long as no human decides otherwise."""

    features: Features
    choice: Choice
    novice: Action = STAND
    experts: tuple[ExpertView, ...] = ()
    threshold: float = 0.0
    speed: float = 1.0
    relieves: bool = False  # a human who has control is asked to let go: who is proposed takes over

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


class Method(ABC):
    """A way of driving and, perhaps, of learning: `propose` is what it has to say, all else has a default.

    `novice` is the policy under training, `UNTAUGHT` where nobody learns, and `experts` are those it asks.
    """

    novice: LearnedPolicy = UNTAUGHT
    experts: Sequence[Expert] = ()

    @property
    def learns(self) -> bool:
        """Whether there is a policy under training."""
        return self.novice is not UNTAUGHT

    @property
    def begins_alone(self) -> bool:
        """Whether somebody drives before a human has shown anything: then a hand has to be there first."""
        return self.novice.stored > 0

    def reset(self) -> None:  # noqa: B027 - there may be nothing to forget
        """Forget what belongs to the past episode."""

    def update(self, now_s: float) -> None:
        """Train if it is time to, and adopt what training has brought by now."""
        self.novice.update(now_s)

    def remember(self, label: Label) -> None:
        """Take in a label that an earlier session stored."""
        self.novice.remember(label)

    @abstractmethod
    def propose(self, features: Features) -> Proposal:
        """Decide as if no human were there."""

    @property
    def drives_several(self) -> bool:
        """Whether it can drive several robots at once: it does not remember what it saw, and learns nothing."""
        return False

    def propose_all(self, seen: Sequence[Features]) -> list[Proposal]:
        """Decide on what several robots see at one time."""
        return [self.propose(each) for each in seen]

    def learn(self, proposal: Proposal, human: Action | None) -> Lesson:
        """Learn from what was executed; `human` is the human's action if the human drove, and then it is the label.

        An idle frame that is to be left out is none.
        """
        if human is None:
            return Lesson(proposal.choice)
        if not self.learns or self.novice.leaves_out(human):
            return Lesson(Choice(Driver.HUMAN, human))
        stored = self.novice.learn(proposal.features, human, Driver.HUMAN, proposal.novice)
        return Lesson(Choice(Driver.HUMAN, human, label=human), stored)

    def policy(self, driver: str) -> Policy:
        """Return the policy behind a driver's name, to look ahead with. Raises `KeyError` for the human.

        One that equals that of another moment does the same wherever it sees the same.
        """
        novice: Policy = AsTaught(self.novice.act, self.novice.training_steps)
        return {**{expert.name: expert.act for expert in self.experts}, Driver.NOVICE: novice}[driver]

    def alone(self, phase: Phase) -> "Method":
        """Return what drives without a teacher, to be proven or on unseen layouts: the novice, if anybody learns."""
        if not self.learns:
            return self
        proving = phase == Phase.PROVE
        return Alone(
            Driver.NOVICE, self.novice.proving if proving else self.novice.alone, self.novice.together(proving=proving)
        )

    @property
    def calls_alone(self) -> bool:
        """Whether what drives alone on unseen layouts may call for somebody to answer."""
        return False

    def close(self) -> None:
        """End the training, in bounded time."""
        self.novice.close()


class Around(Method):
    """A method around another one, which does all that is not said otherwise here."""

    def __init__(self, method: Method) -> None:
        self._method = method
        self.novice, self.experts = method.novice, method.experts

    @property
    def begins_alone(self) -> bool:
        """As the other does."""
        return self._method.begins_alone

    @property
    def calls_alone(self) -> bool:
        """As the other does."""
        return self._method.calls_alone

    @property
    def drives_several(self) -> bool:
        """As the other does."""
        return self._method.drives_several

    def reset(self) -> None:
        """Begin an episode."""
        self._method.reset()

    def update(self, now_s: float) -> None:
        """Train, and adopt what training has brought."""
        self._method.update(now_s)

    def remember(self, label: Label) -> None:
        """Take in a label from before."""
        self._method.remember(label)

    def propose(self, features: Features) -> Proposal:
        """Propose what the other does."""
        return self._method.propose(features)

    def learn(self, proposal: Proposal, human: Action | None) -> Lesson:
        """Learn what the other does."""
        return self._method.learn(proposal, human)

    def policy(self, driver: str) -> Policy:
        """The policy behind a driver's name."""
        return self._method.policy(driver)

    def alone(self, phase: Phase) -> Method:
        """What drives without a teacher."""
        return self._method.alone(phase)

    def close(self) -> None:
        """End the training, in bounded time."""
        self._method.close()


@runtime_checkable
class Chooser(Protocol):
    """A method that a person may tell which expert shall drive: the answer to a call."""

    @property
    def offers(self) -> Mapping[str, Policy]:
        """Who can be given control."""

    def choose(self, name: str) -> str | None:
        """Give the expert of that name control. Returns why not, None if it drives from now on."""


@dataclass(frozen=True, slots=True)
class Alone(Method):
    """A policy that drives by itself and learns nothing: an expert on show, or the novice's proving run.

    `together`, if there is one, is the same policy on what several robots see.
    """

    name: str
    act: Policy
    together: Together | None = None

    def propose(self, features: Features) -> Proposal:
        """Propose the policy's own action."""
        return self._proposal(features, self.act(features))

    @property
    def drives_several(self) -> bool:
        """Where the policy says what it does together."""
        return self.together is not None

    def propose_all(self, seen: Sequence[Features]) -> list[Proposal]:
        """Propose the policy's own actions."""
        actions = [self.act(each) for each in seen] if self.together is None else self.together(seen)
        return [self._proposal(*each) for each in zip(seen, actions, strict=True)]

    def _proposal(self, features: Features, action: Action) -> Proposal:
        return Proposal(features, Choice(self.name, action), novice=action)

    def policy(self, driver: str) -> Policy:  # noqa: ARG002 - whoever drives, it is this one
        """Return the one policy there is."""
        return self.act
