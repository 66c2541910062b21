"""Notes every call of a method, with what it got and what came of it: enough to go through all of it again.

What is learned and decided depends on nothing but these calls: their order, the features, the human's actions, and the
moments at which new weights were adopted. So a recording that has them can be gone through offline, by the same method
to the bit, or by another one.
"""

import hashlib
from collections.abc import Callable, Mapping
from typing import Any

import msgspec
import numpy as np

from lira.fusion.learning.labels import Label
from lira.fusion.learning.learned_policy import LearnedPolicy
from lira.fusion.methods.base import Around, Choice, Chooser, Lesson, Method, Policy, Proposal
from lira.fusion.preprocess import MODALITIES, Features, shapes_of
from lira.hal.messages import Action, CallName, ExpertView, FeatureArray, MethodCall, MethodCalls, Phase
from lira.hal.profile import RobotProfile

Tell = Callable[[MethodCalls], None]
MOST_BYTES = 32 * 2**10  # of features in one message: labels from before are many


class Decided(msgspec.Struct, frozen=True):
    """What came of `propose`, but for the features."""

    choice: Choice
    novice: Action
    experts: tuple[ExpertView, ...]
    threshold: float
    speed: float
    relieves: bool

    @classmethod
    def of(cls, proposal: Proposal) -> "Decided":
        """Take over what was proposed."""
        p = proposal
        return cls(p.choice, p.novice, p.experts, p.threshold, p.speed, p.relieves)


class Learned(msgspec.Struct, frozen=True):
    """What came of `learn`. `settled` tells of labels that were decided on now, oldest first, whether each was kept."""

    choice: Choice
    stored: bool
    reserved: bool
    settled: tuple[bool, ...]

    @classmethod
    def of(cls, lesson: Lesson) -> "Learned":
        """Take over what was learned."""
        return cls(lesson.choice, lesson.stored, lesson.reserved, tuple(each.stored for each in lesson.settled))


class State(msgspec.Struct, frozen=True):
    """How far the novice is: labels, training steps, and with `weights` what it drives by, as a digest."""

    labels: int
    steps: int
    weights: str = ""

    @classmethod
    def of(cls, novice: LearnedPolicy, *, weights: bool) -> "State":
        """Look at a novice; at its weights only if asked to, since that takes milliseconds."""
        return cls(novice.stored, novice.training_steps, digest(novice) if weights else "")


def digest(novice: LearnedPolicy) -> str:
    """What tells a novice from another that drives differently; "" for one without a network, or before it learned."""
    network = novice.frozen() if novice.trained else None
    if network is None:
        return ""
    found = hashlib.blake2b(digest_size=16)
    for name, array in sorted(network.weights().items()):
        found.update(f"{name}{array.shape}{array.dtype}".encode())
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def kept(features: Features) -> tuple[FeatureArray, ...]:
    """Features as labels keep them, which loses nothing."""
    return tuple(FeatureArray(name, MODALITIES[name].keep(array).tobytes()) for name, array in features.items())


def restored(arrays: tuple[FeatureArray, ...], profile: RobotProfile) -> Features:
    """Inverse of `kept`. Raises `ValueError` or `KeyError` for what is of another robot."""
    shapes = shapes_of(profile)
    return Features(
        **{
            each.name: MODALITIES[each.name].restore(
                np.frombuffer(each.data, MODALITIES[each.name].dtype).reshape(shapes[each.name])
            )
            for each in arrays
        }
    )


class _Notes:
    """Calls that were not told yet. A step is told when it is over, so that it is one message."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._calls: list[MethodCall] = []
        self._bytes = 0
        self._now_s = 0.0
        self.drivers = 0  # that `alone` has given

    def add(self, name: CallName, target: int = 0, outcome: Any = None, **about: Any) -> None:
        text = "" if outcome is None else msgspec.json.encode(outcome).decode()
        call = MethodCall(name, target, outcome=text, **about)
        self._now_s = call.time_s or self._now_s
        self._calls.append(call)
        self._bytes += sum(len(each.data) for each in call.features)
        if self._bytes > MOST_BYTES:
            self.flush()

    def flush(self) -> None:
        if self._calls:
            self._tell(MethodCalls(self._now_s, tuple(self._calls)))
            self._calls, self._bytes = [], 0


class TracedMethod(Around):
    """A method, or a driver that it gave, whose calls are told."""

    def __init__(self, method: Method, notes: _Notes, target: int = 0) -> None:
        super().__init__(method)
        self._notes, self._target = notes, target
        self._state = State.of(self.novice, weights=False)

    def remember(self, label: Label) -> None:
        """Have the novice take in a label from before."""
        self._notes.add(CallName.REMEMBER, argument=label.source, action=label.action, features=kept(label.features))
        self._method.remember(label)

    def reset(self) -> None:
        """Begin an episode."""
        self._method.reset()
        self._notes.add(CallName.RESET, self._target, State.of(self.novice, weights=True))

    def update(self, now_s: float) -> None:
        """Train and adopt; what is told says when that was."""
        self._notes.flush()
        self._method.update(now_s)
        before, self._state = self._state, State.of(self.novice, weights=False)
        outcome = None if self._state == before else self._state
        self._notes.add(CallName.UPDATE, self._target, outcome, time_s=now_s)

    def propose(self, features: Features) -> Proposal:
        """Propose what it proposes."""
        proposal = self._method.propose(features)
        # What is no proposal is for the loop to refuse.
        outcome = Decided.of(proposal) if isinstance(proposal, Proposal) else None
        self._notes.add(CallName.PROPOSE, self._target, outcome, features=kept(features))
        return proposal

    def learn(self, proposal: Proposal, human: Action | None) -> Lesson:
        """Learn what it learns; with that a step is over."""
        lesson = self._method.learn(proposal, human)
        self._notes.add(CallName.LEARN, self._target, Learned.of(lesson), action=human)
        self._notes.flush()
        return lesson

    def alone(self, phase: Phase) -> Method:
        """Return what drives alone; it is told of, too."""
        driver = self._method.alone(phase)
        self._notes.drivers += 1
        self._notes.add(CallName.ALONE, self._target, argument=phase)
        return _around(driver, self._notes, self._notes.drivers)

    def close(self) -> None:
        """End the training, in bounded time."""
        if self._target == 0:
            self._notes.add(CallName.END, 0, State.of(self.novice, weights=True))
            self._notes.flush()
        self._method.close()


class TracedChooser(TracedMethod):
    """One that a person may tell which expert shall drive."""

    @property
    def offers(self) -> Mapping[str, Policy]:
        """Who can be given control."""
        assert isinstance(self._method, Chooser)
        return self._method.offers

    def choose(self, name: str) -> str | None:
        """Give the expert of that name control."""
        assert isinstance(self._method, Chooser)
        refusal = self._method.choose(name)
        self._notes.add(CallName.CHOOSE, self._target, refusal, argument=name)
        return refusal


def traced(method: Method, settings: bytes, tell: Tell) -> TracedMethod:
    """Have a new method's calls told; `settings` (JSON) are what it was built from."""
    notes = _Notes(tell)
    notes.add(CallName.BEGIN, 0, State.of(method.novice, weights=True), argument=settings.decode())
    notes.flush()
    return _around(method, notes, 0)


def _around(method: Method, notes: _Notes, target: int) -> TracedMethod:
    return (TracedChooser if isinstance(method, Chooser) else TracedMethod)(method, notes, target)
