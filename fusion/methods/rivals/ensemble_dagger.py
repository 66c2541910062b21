"""EnsembleDAgger (Menda, Driggs-Campbell & Kochenderfer, IROS 2019; reference 32 of the thesis).

The novice drives iff both rules say that it may, else the expert does:

    discrepancy rule   ||a^N - a^H||^2 <= tau
    doubt rule         d(O) <= chi, the norm of the variances of an ensemble's actions

The paper's expert is a program that can be asked in every step. A person is not, so while the robot drives the doubt
rule alone hands over, and the person beside it, who takes over where it is about to err, stands for the other one. The
control goes back when both rules agree. The paper sets chi by hand, for one network; here it follows from the doubts
at which a person took over uncalled, as HG-DAgger's threshold does, so that any novice's doubt will do.
"""

from lira.fusion.learning.novice import Novice
from lira.fusion.methods.base import Method, Proposal
from lira.fusion.methods.context import Context, MethodSettings
from lira.fusion.methods.doubt import DoubtLog, doubt_of
from lira.fusion.methods.rivals.gated import RobotGated, discrepancy
from lira.fusion.preprocess import Features
from lira.hal.messages import Action


class EnsembleDaggerSettings(MethodSettings, frozen=True, tag="ensemble-dagger"):
    """tau, and chi if it is to be fixed, in squared units of the action; and the size of the ensemble, which a kernel's
    doubt does not need.
    """

    tau: float = 0.25
    chi: float | None = None
    ensemble: int = 5

    def build(self, context: Context) -> Method:
        """Teach a novice that can doubt. Raises `ConfigError` for one that cannot."""
        novice = context.novice(ensemble=self.ensemble)
        return EnsembleDagger(novice, DoubtLog(doubt_of(novice)), self)


class EnsembleDagger(RobotGated):
    """The person drives where the ensemble disagrees, until it agrees with itself and with the person."""

    def __init__(self, novice: Novice, log: DoubtLog, settings: EnsembleDaggerSettings) -> None:
        self._log, self._settings = log, settings
        super().__init__(novice)

    @property
    def chi(self) -> float:
        """What doubt may come to."""
        return self._log.threshold if self._settings.chi is None else self._settings.chi

    def hands_over(self, features: Features, a_n: Action) -> bool:  # noqa: ARG002
        """The doubt rule."""
        return self._log.doubt(features) > self.chi

    def hands_back(self, features: Features, a_n: Action, a_h: Action) -> bool:
        """Both rules."""
        return discrepancy(a_n, a_h) <= self._settings.tau and self._log.doubt(features) <= self.chi

    def saw(self, proposal: Proposal, human: Action | None, *, uncalled: bool) -> None:  # noqa: ARG002
        """Note the doubt at which a person thought it better to drive."""
        if uncalled:
            self._log.take_over(proposal.features)
