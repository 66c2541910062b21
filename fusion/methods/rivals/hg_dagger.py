"""HG-DAgger (Kelly et al., 2019): the human gates, and only what the human drives is learned.

At test time the novice may doubt: `fusion/methods/doubt.py`.
"""

from lira.fusion.learning.novice import Novice
from lira.fusion.methods.base import ASK, Choice, Lesson, Method, Proposal
from lira.fusion.methods.context import Context, MethodSettings
from lira.fusion.methods.doubt import DoubtLog, doubt_of
from lira.fusion.methods.stop_and_ask import Doubtful
from lira.fusion.preprocess import Features
from lira.hal.messages import Action, Driver, Phase


class HgDaggerSettings(MethodSettings, frozen=True, tag="hg-dagger"):
    """In which runs the novice, driving alone, stops when it is in doubt, and how many policies it asks about that.

    Without any there is no ensemble. With one the novice learns what it learns without.
    """

    doubt: tuple[Phase, ...] = ()
    ensemble: int = 5

    def build(self, context: Context) -> Method:
        """Teach a novice, with an ensemble if it is to doubt."""
        novice = context.novice(ensemble=self.ensemble if self.doubt else 0)
        return HgDagger(novice, DoubtLog(doubt_of(novice)) if self.doubt else None, self.doubt)


class HgDagger(Method):
    """The novice drives; the human takes control when the novice errs. It also trains the experts.

    `log`, if there is one, notes how much the novice doubted whenever the human took over; driving alone, the novice
    stops and asks in the phases `doubt`.
    """

    novice: Novice

    def __init__(self, novice: Novice, log: DoubtLog | None = None, doubt: tuple[str, ...] = ()) -> None:
        self.novice = novice
        self.log = log
        self._doubt = doubt
        self.reset()

    def reset(self) -> None:
        """Nobody has control when an episode begins."""
        self._human_drove = False

    def propose(self, features: Features) -> Proposal:
        """The novice's action; before its first training step it asks the human to drive."""
        a_n = self.novice.act(features)
        if not self.novice.trained:
            return Proposal(features, ASK, a_n)
        return Proposal(features, Choice(Driver.NOVICE, a_n), a_n)

    def learn(self, proposal: Proposal, human: Action | None) -> Lesson:
        """Store the human's action, unless it is an idle frame that is to be left out."""
        taken_over = human is not None and not self._human_drove
        self._human_drove = human is not None
        if taken_over and self.log is not None and self.novice.trained:
            self.log.take_over(proposal.features)
        return super().learn(proposal, human)

    def alone(self, phase: Phase) -> Method:
        """The novice, which may doubt."""
        if self.log is not None and phase in self._doubt:
            return Doubtful(self.novice.alone, self.log.exceeds)
        return super().alone(phase)

    @property
    def calls_alone(self) -> bool:
        """Whether it doubts on unseen layouts."""
        return self.log is not None and Phase.UNSEEN in self._doubt
