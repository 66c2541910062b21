"""The methods that are compared, from the one table. Same experts, same teacher, same layouts: the method differs.

Here all are taught and proven on one layout, as in the thesis, also those that do otherwise elsewhere.
"""

from msgspec.structs import replace

from lira.fusion.methods.presets import METHODS, Preset
from lira.fusion.methods.syllabus import THESIS


def as_in_the_thesis(name: str) -> Preset:
    """A method that is taught and proven on its own layout."""
    return replace(METHODS[name], syllabus=THESIS)


LIRA = tuple(map(as_in_the_thesis, ("hold", "hold-mirrored", "hold-scratch", "thesis", "plus")))
HG_DAGGER = tuple(
    as_in_the_thesis(f"hg-dagger{kind}")
    for kind in ("", "-m10", "-mirrored", "-trunks", "-warm", "-warm-m10", "-warm-m10-mirrored")
)
FLOORS = tuple(map(as_in_the_thesis, ("cloning", "switching")))  # no interaction, no learning
ALL = (*LIRA, *HG_DAGGER, *FLOORS)
# The thesis's two, what goes beyond them, and HG-DAgger with the same experts: played where no others are asked for.
USUAL = tuple(map(as_in_the_thesis, ("hold", "plus", "hg-dagger", "hg-dagger-warm-m10")))
FUSED = tuple(method for method in USUAL if method in LIRA)
DRAWN = (*FUSED, HG_DAGGER[0])  # those whose labels and drives are looked at
