"""Which layouts are driven to learn, and what counts as proof: layouts that nobody was taught on.

A lap on the layout that was just taught says little about others (the thesis's definition, kept for its tables). So
training laps may each be on a layout of their own, and the proof a few layouts in a row that nobody has driven yet.
"""

from typing import Annotated, Literal

from msgspec import Meta

from hal.config import Table
from hal.errors import ConfigError

TAUGHT, PROVEN = 10_000_000, 20_000_000  # layouts from here on are fresh ones; those shown afterwards are below
PER_RUN = 1_000


class Syllabus(Table, frozen=True):
    """`layouts`: training laps on the run's own layout, or each on a fresh one. `proofs`: fresh layouts in a row that
    the novice alone has to pass; 0: one lap of the layout it was just taught on.
    """

    layouts: Literal["own", "fresh"] = "own"
    proofs: Annotated[int, Meta(ge=0, le=100)] = 0

    @property
    def proof(self) -> str:
        """The proof as it is written on a command line."""
        return f"fresh:{self.proofs}" if self.proofs else "own"

    def taught(self, layout: int, lap: int) -> int:
        """Layout of a training lap, laps counting from 1, of a run whose own layout this is."""
        return layout if self.layouts == "own" else TAUGHT + PER_RUN * layout + lap

    def proven(self, layout: int, lap: int) -> list[int]:
        """Layouts to be passed after a training lap; each of them is driven once in a run."""
        if not self.proofs:
            return [self.taught(layout, lap)]
        return [PROVEN + PER_RUN * layout + self.proofs * (lap - 1) + k for k in range(self.proofs)]


THESIS = Syllabus()
FRESH = Syllabus("fresh", 3)


def proofs_of(words: str) -> int:
    """Read a proof: "own" or "fresh:K". Raises `ConfigError`."""
    kind, _, count = words.partition(":")
    if words == "own":
        return 0
    if kind != "fresh" or not count.isdecimal() or not 0 < int(count) <= 100:
        raise ConfigError(f"'{words}' is no proof", "Give own, or fresh:K for K unseen layouts in a row, like fresh:3.")
    return int(count)
