"""What a method is before a run begins: settings that build it from what the run has to offer."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol, Self

from lira.fusion.methods.base import Expert, Method
from lira.hal.config import Table
from lira.hal.errors import ConfigError
from lira.hal.profile import RobotProfile

if TYPE_CHECKING:
    from lira.fusion.learning.novice import Novice


Trunks = Literal["frozen", "scratch"]


class NewNovice(Protocol):
    """Makes the policy under training."""

    def __call__(self, *, ensemble: int = 0, trunks: Trunks | None = None, m: int | None = None) -> "Novice":
        """Make a novice the way the preset wants it, if nothing else is said here.

        `ensemble`: so many more heads to tell its doubt. `trunks`: "frozen" copies of the experts', or from "scratch".
        `m`: a training step after so many labels. All three are about a network; a kernel regression needs none.
        """


@dataclass(frozen=True, slots=True)
class Context:
    """What a method is built from: the robot, the experts (camera, lidar, then a user's own), a seed, and `novice()`.

    Calling `novice` makes the policy under training; a method that trains one of its own does not call it.
    """

    profile: RobotProfile
    experts: tuple[Expert, ...]
    seed: int
    novice: NewNovice

    @property
    def period_s(self) -> float:
        """Time between two decisions."""
        return self.profile.period_s


class MethodSettings(Table, frozen=True):
    """Base of a method's settings: plain values that can be written down, and `build`."""

    def build(self, context: Context) -> Method:
        """Build the method. Raises `ConfigError` where the context lacks what it needs."""
        raise NotImplementedError

    def starting(self, who: str) -> Self:  # noqa: ARG002
        """Return the same with another driver before the first training step. Raises `ConfigError`."""
        raise ConfigError(f"'{self.kind}' takes no --start", "Only LIRA-SPF does.")

    @property
    def learns(self) -> bool:
        """Whether anybody learns by it, as far as that can be told before it is built."""
        return True

    def source(self) -> bytes:
        """Return the source of a method that is none of the project's, by which kept trials are told from new ones."""
        return b""

    @property
    def kind(self) -> str:
        """Which method it is, in one word."""
        return str(type(self).__struct_config__.tag or type(self).__name__)
