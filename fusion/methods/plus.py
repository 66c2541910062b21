"""`plus`: LIRA-SPF with what the thesis leaves to future work. Each part can be switched off in `PlusSettings`.

- Pre-fill: before anybody teaches it, the novice learns what the first expert does while the others are quiet, and
  what active experts agree on.
- Reservation: an expert's label counts only once a second has passed without the human correcting what the expert did.
- A choice as an answer: instead of driving, the human may give control to an expert for a while.
- Practice: a novice that was once examined drives as it will alone, and is only corrected.
- Sureness: where the experts disagree and the novice says that it knows, it drives, and nobody is called.

Its novice is that of `fusion/learning/kernel_novice.py`.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace

from lira.fusion.learning.novice import Novice
from lira.fusion.methods.base import AsTaught, Choice, Expert, Lesson, Method, Policy, Proposal, Settled
from lira.fusion.methods.context import Context, MethodSettings
from lira.fusion.methods.lira import LiraSettings, LiraSpf, choose
from lira.fusion.methods.stop_and_ask import Doubtful
from lira.fusion.preprocess import Features
from lira.hal.messages import Action, Call, Driver, Phase


class PlusSettings(MethodSettings, frozen=True, tag="plus"):
    """What `plus` adds to `lira`. 0 switches a part off, for `sure` None."""

    lira: LiraSettings = LiraSettings()
    prefill: int = 25  # labels of the experts before the human is asked, for every expert but the first
    reserve_s: float = 1.0  # an expert's label waits so long for the human's objection
    handover_s: float = 1.0  # an expert that was given control keeps it so long
    sure: float | None = None  # surer than at all but this share of what the human showed, the novice is not helped
    practice: bool = False  # from its first proving run on, the novice drives and the human corrects it
    ask: bool = False  # on unseen layouts it stops and asks where it doubts

    def filled_by(self, experts: int) -> int:
        """How many labels of so many experts fill the novice: each further one may disagree with the others."""
        return self.prefill * (experts - 1)

    def build(self, context: Context) -> Method:
        """Teach a novice with these experts."""
        return LiraPlus(context.experts, context.novice(), self, context.period_s)


class LiraPlus(LiraSpf):
    """LIRA-SPF that asks less."""

    def __init__(self, experts: Sequence[Expert], novice: Novice, settings: PlusSettings, period_s: float) -> None:
        self._plus = settings
        self._reserve = round(settings.reserve_s / period_s)
        self._handover_steps = round(settings.handover_s / period_s)
        self._gifts = 0
        self._examined = False
        super().__init__(experts, novice, settings.lira, period_s)

    def reset(self) -> None:
        """Begin an episode: nobody has been given control, and what is reserved is dropped."""
        super().reset()
        self._reserved: deque[Proposal] = deque()
        self._driver, self._left = "", 0

    @property
    def begins_alone(self) -> bool:
        """Also where the experts fill the novice first."""
        return self._plus.prefill > 0 or super().begins_alone

    @property
    def offers(self) -> Mapping[str, Policy]:
        """Who can be given control."""
        return {expert.name: expert.act for expert in self.experts} if self._handover_steps else {}

    def choose(self, name: str) -> str | None:
        """Give an expert control for a while. Returns why not, None if it drives from now on."""
        if name not in self.offers:
            return f"there is no expert {name!r} to choose"
        self._driver, self._left = name, self._handover_steps
        self._gifts += 1
        return None

    def propose(self, features: Features) -> Proposal:
        """Algorithm 1, unless an expert was given control, the novice is sure, or all begins."""
        proposal = super().propose(features)
        if self._left:
            action = next(view.action for view in proposal.experts if view.name == self._driver)
            return replace(proposal, choice=Choice(self._driver, action, label=action, given=self._gifts), speed=1.0)
        if self.novice.stored < self._plus.filled_by(len(self.experts)):
            return self._prefill(proposal)
        if self._practises:
            a_n = self.novice.alone(features)
            return replace(proposal, choice=Choice(Driver.NOVICE, a_n), novice=a_n, speed=1.0)
        if proposal.choice.call is not Call.NONE and self.novice.trained and self._sure(features):
            return replace(proposal, choice=Choice(Driver.NOVICE, proposal.novice), speed=1.0)
        return proposal

    def learn(self, proposal: Proposal, human: Action | None) -> Lesson:
        """Learn from the human at once, and from an expert when nobody has objected for a while."""
        objection = human is not None or (proposal.choice.given and self._left == self._handover_steps)
        dropped = self._drop() if objection else ()
        if human is not None:
            self._left = 0
            return replace(super().learn(proposal, human), settled=dropped)
        self._left = max(0, self._left - 1)
        if not self._reserve or proposal.choice.label is None:
            return replace(super().learn(proposal, None), settled=dropped)
        self._reserved.append(proposal)
        settled = dropped
        while len(self._reserved) > self._reserve:
            past = self._reserved.popleft()
            settled = (*settled, Settled(past, super().learn(past, None).stored))
        return Lesson(proposal.choice, reserved=True, settled=settled)

    def alone(self, phase: Phase) -> Method:
        """The novice, which on unseen layouts may stop and ask. Who drives a proving run is examined."""
        self._examined = True
        if phase == Phase.UNSEEN and self.calls_alone:
            return Doubtful(self.novice.alone, self.novice.doubts)
        return super().alone(phase)

    @property
    def calls_alone(self) -> bool:
        """Whether it asks on unseen layouts."""
        return self._plus.ask

    def policy(self, driver: str) -> Policy:
        """The policy behind a driver's name: a novice that practises drives as it does alone."""
        if driver == Driver.NOVICE and self._practises:
            return AsTaught(self.novice.alone, self.novice.training_steps)
        return super().policy(driver)

    @property
    def _practises(self) -> bool:
        return self._plus.practice and self._examined

    def _drop(self) -> tuple[Settled, ...]:
        dropped = tuple(Settled(past, stored=False) for past in self._reserved)
        self._reserved.clear()
        return dropped

    def _prefill(self, proposal: Proposal) -> Proposal:
        """The first expert drives, or another that alone is active; the human is called where they disagree."""
        first = self.experts[0].name
        a_1 = proposal.experts[0].action
        choice = choose(None, proposal.experts, a_1, self._consensus)
        if choice.driver == Driver.NOVICE:  # nobody is active, or they disagree
            choice = replace(choice, driver=first, label=a_1 if choice.call is Call.NONE else None)
        elif choice.driver not in (first, Driver.MEAN):
            choice = replace(choice, label=None)
        return replace(proposal, choice=choice, speed=self.settings.slow_down if choice.call is Call.FEEDBACK else 1.0)

    def _sure(self, features: Features) -> bool:
        """Whether the novice knows what to do here."""
        return self._plus.sure is not None and self.novice.knows(features, self._plus.sure)
