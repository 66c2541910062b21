"""Goes through a recorded run again, offline: what the method saw and what the human did, in the same order.

By the same method everything comes out the same, to the bit, or it is said where it parts. By another method or with
other settings it is an open question what the human would have done then: the recorded human answers, and the robot is
where it was.
"""

import math
from dataclasses import dataclass, field

from lira.fusion.inference.architecture import Weights
from lira.fusion.inference.threads import one_thread
from lira.fusion.learning.labels import Label
from lira.fusion.learning.learned_policy import LearnedPolicy
from lira.fusion.learning.trainer import Beginning, InlineTrainer
from lira.fusion.log.method_trace import Decided, Learned, State, restored
from lira.fusion.methods.base import Chooser, Method, Proposal
from lira.fusion.preprocess import Features
from lira.hal.errors import ConfigError, PluginError, StorageError
from lira.hal.messages import CallName, MethodCall, Phase
from lira.hal.profile import RobotProfile
from lira.tools.inquiry.trace import OUTCOMES, Trace, outcome_of
from lira.tools.runs.build import build_method
from lira.tools.runs.plan import Recipe

MOST_DIFFERENCES = 20


class ToldTrainer(InlineTrainer):
    """Hands its weights out when it is told that this is when they were adopted."""

    def __init__(self, beginning: Beginning, *, adopt_after_s: float) -> None:
        super().__init__(beginning, adopt_after_s=adopt_after_s)
        self.follows = False  # until then, as on a twin: so long after the start of the training step
        self.told = False

    def poll(self, now_s: float) -> Weights | None:
        """Return new weights once, when they were adopted."""
        if not self.follows:
            return super().poll(now_s)
        if not self.told:
            return None
        self.told = False
        return super().poll(math.inf)


@dataclass(frozen=True, slots=True)
class Difference:
    """Where two ways part: the number of the call, what was asked, and what came of it in each.

    `time_s` counts from when the recording began.
    """

    number: int
    time_s: float
    name: str
    was: object
    now: object


@dataclass(slots=True)
class Again:
    """What came of going through it again: `outcomes` by the number of the call, and where it parted at first."""

    trace: Trace
    outcomes: dict[int, object] = field(default_factory=dict)
    differences: list[Difference] = field(default_factory=list)
    compared: int = 0
    final: State | None = None

    @property
    def proposed(self) -> list[int]:
        """Numbers of the calls that were decisions."""
        return [number for number, outcome in self.outcomes.items() if isinstance(outcome, Decided)]

    @property
    def identical(self) -> bool:
        """Whether all came out the same."""
        return not self.differences and not self.trace.missing


def go_again(trace: Trace, profile: RobotProfile, recipe: Recipe | None = None) -> Again:
    """Go through a trace, by the same method or by that of another `recipe`.

    Raises `ConfigError` for a method or experts that cannot be built here.
    """
    one_thread()
    return _Run(trace, profile, recipe).go()


def novice_before(trace: Trace, profile: RobotProfile, number: int) -> tuple[LearnedPolicy, Features]:
    """Go through a trace up to a call that proposed; return the novice as it was then, and what was seen.

    Raises `ConfigError` as `go_again` does.
    """
    one_thread()
    run = _Run(trace, profile, None)
    run.go(until=number)
    return run.novice, restored(trace.calls[number].features, profile)


class _Run:
    def __init__(self, trace: Trace, profile: RobotProfile, other: Recipe | None) -> None:
        self._trace, self._profile = trace, profile
        self._same = other is None
        self._trainers: list[ToldTrainer] = []
        recipe = other or trace.recipe
        if recipe.missing:
            raise ConfigError(f"this run cannot be gone through again: {recipe.missing}", "Name it MODULE:OBJECT.")
        self._method = build_method(recipe.preset, profile, recipe.seed, self._trainer, recipe.pair, recipe.more)
        for trainer in self._trainers:
            trainer.follows = self._same
        self._drivers: list[Method] = [self._method]
        self._states = [State.of(self._method.novice, weights=False)]  # of each driver's novice at its last update
        self._proposals: dict[int, Proposal] = {}  # the newest of each driver
        self._again = Again(trace)
        self._time_s = 0.0

    def _trainer(self, beginning: Beginning) -> ToldTrainer:
        trainer = ToldTrainer(beginning, adopt_after_s=self._profile.period_s)
        self._trainers.append(trainer)
        return trainer

    @property
    def novice(self) -> LearnedPolicy:
        """The policy under training, as it is by now."""
        return self._method.novice

    def go(self, until: int | None = None) -> Again:
        """Make all calls, or those before a number."""
        again, calls = self._again, self._trace.calls[:until]
        try:
            for number, call in enumerate(calls):
                outcome = self._call(call)
                again.outcomes[number] = outcome
                if self._same and call.name in OUTCOMES:
                    self._compare(number, call, outcome)
                if len(again.differences) >= MOST_DIFFERENCES:
                    break
            again.final = State.of(self._method.novice, weights=True)
        finally:
            self._method.close()
        return again

    def _compare(self, number: int, call: MethodCall, outcome: object) -> None:
        self._again.compared += 1
        was = outcome_of(call, OUTCOMES[call.name]) if call.outcome else None
        if was != outcome and repr(was) != repr(outcome):  # nan is no number, and the same
            self._again.differences.append(
                Difference(number, self._time_s - self._trace.began_s, call.name, was, outcome)
            )

    def _call(self, call: MethodCall) -> object:
        """Make one call, and return what came of it where something was recorded of that."""
        if call.target >= len(self._drivers):
            raise StorageError("the recording lacks who drove", "Part of it was not recorded.")
        driver = self._drivers[call.target]
        match call.name:
            case CallName.UPDATE:
                return self._update(driver, call)
            case CallName.PROPOSE:
                return self._propose(driver, call)
            case CallName.LEARN:
                proposal = self._proposals[call.target]
                return Learned.of(driver.learn(proposal, call.action))
            case CallName.CHOOSE:
                if isinstance(driver, Chooser):
                    driver.choose(call.argument)
            case CallName.ALONE:
                self._drivers.append(driver.alone(Phase(call.argument)))
                self._states.append(State.of(self._drivers[-1].novice, weights=False))
            case CallName.REMEMBER:
                assert call.action is not None
                weight = driver.novice.weight(call.argument)
                driver.remember(Label(restored(call.features, self._profile), call.action, call.argument, weight))
            case CallName.RESET:
                driver.reset()
                return State.of(driver.novice, weights=True)
            case CallName.BEGIN | CallName.END:
                return State.of(driver.novice, weights=True)
        return None

    def _update(self, driver: Method, call: MethodCall) -> State | None:
        """As `TracedMethod.update`: nothing is told of a novice that is as it was at the last one."""
        self._time_s = call.time_s
        was = outcome_of(call, State) if call.outcome else None
        for trainer in self._trainers:
            trainer.told = was is not None and was.steps > driver.novice.training_steps
        driver.update(call.time_s)
        before, now = self._states[call.target], State.of(driver.novice, weights=False)
        self._states[call.target] = now
        return None if now == before else now

    def _propose(self, driver: Method, call: MethodCall) -> object:
        proposal = driver.propose(restored(call.features, self._profile))
        if not isinstance(proposal, Proposal):
            raise PluginError(f"the method proposed {proposal!r}", "Let `propose` return a lira.Proposal.")
        self._proposals[call.target] = proposal
        return Decided.of(proposal)
