"""Which layouts are driven to learn, and what counts as proof: layouts that nobody was taught on.

A lap on the layout that was just taught says little about others (the thesis's definition, kept for its tables). So
training laps may each be on a layout of their own, and the proof a few layouts in a row that nobody has driven yet.
"""

from typing import Annotated, Literal

from msgspec import Meta
from msgspec.structs import replace

from lira.hal.config import Table
from lira.hal.errors import ConfigError

MOST = 80  # proving runs after a lap, so that those of twelve laps fit into the numbers of a run
REMEDY = "Give own, or fresh:K for K unseen layouts in a row, like fresh:3, or fresh:11/12 for 11 of 12."
Count = Annotated[int, Meta(ge=0, le=MOST)]
TAUGHT, PROVEN = 10_000_000, 20_000_000  # layouts from here on are fresh ones; those shown afterwards are below
PER_RUN = 1_000


class Syllabus(Table, frozen=True):
    """`layouts`: training laps on the run's own layout, or each on a fresh one. `proofs`: so many fresh layouts the
    novice alone has to pass, of which `spare` may fail; 0: one lap of the layout it was just taught on.
    """

    layouts: Literal["own", "fresh"] = "own"
    proofs: Count = 0
    spare: Count = 0

    @property
    def proof(self) -> str:
        """The proof as it is written on a command line."""
        if not self.proofs:
            return "own"
        return f"fresh:{self.proofs}" if not self.spare else f"fresh:{self.proofs - self.spare}/{self.proofs}"

    @property
    def most_laps(self) -> int:
        """After so many laps a run has no proving layouts of its own left."""
        return PER_RUN // max(1, self.proofs)

    def taught(self, layout: int, lap: int) -> int:
        """Layout of a training lap, laps counting from 1, of a run whose own layout this is."""
        return layout if self.layouts == "own" else TAUGHT + PER_RUN * layout + lap

    def proven(self, layout: int, lap: int) -> list[int]:
        """Layouts of the proving runs after a training lap; each of them is driven once in a run."""
        if not self.proofs:
            return [self.taught(layout, lap)]
        return [PROVEN + PER_RUN * layout + self.proofs * (lap - 1) + k for k in range(self.proofs)]


THESIS = Syllabus()
FRESH = Syllabus("fresh", 3)


def with_proof(syllabus: Syllabus, words: str) -> Syllabus:
    """Return a syllabus with another proof: "own", "fresh:K" or "fresh:K/N". Raises `ConfigError`."""
    kind, _, count = words.partition(":")
    passed, of, shown = count.partition("/")
    numbers = [passed, shown] if of else [passed, passed]
    if kind == "own" and not count:
        return replace(syllabus, proofs=0, spare=0)
    if kind != "fresh" or not all(each.isdecimal() and int(each) <= MOST for each in numbers):
        raise ConfigError(f"'{words}' is no proof", REMEDY)
    least, most = map(int, numbers)
    if not 0 < least <= most:
        raise ConfigError(f"'{words}' is no proof", REMEDY)
    return replace(syllabus, proofs=most, spare=most - least)
