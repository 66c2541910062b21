"""The methods that are compared, from the one table. Same experts, same teacher, same layouts: the method differs."""

from fusion.presets import METHODS

LIRA = tuple(METHODS[name] for name in ("hold", "hold-mirrored", "hold-scratch", "thesis", "plus"))
HG_DAGGER = tuple(
    METHODS[f"hg-dagger{kind}"]
    for kind in ("", "-m10", "-mirrored", "-trunks", "-warm", "-warm-m10", "-warm-m10-mirrored")
)
FLOORS = tuple(METHODS[name] for name in ("cloning", "switching"))  # no interaction, no learning
ALL = (*LIRA, *HG_DAGGER, *FLOORS)
# The thesis's two, what goes beyond them, and HG-DAgger with the same experts: played where no others are asked for.
USUAL = tuple(METHODS[name] for name in ("hold", "plus", "hg-dagger", "hg-dagger-warm-m10"))
FUSED = tuple(method for method in USUAL if method in LIRA)
DRAWN = (*FUSED, HG_DAGGER[0])  # those whose labels and drives are looked at
