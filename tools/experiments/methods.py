"""The methods that are compared, from the one table. Same experts, same teacher, same layouts: the method differs."""

from fusion.presets import METHODS

LIRA = tuple(METHODS[name] for name in ("hold", "hold-scratch", "thesis", "plus"))
HG_DAGGER = tuple(
    METHODS[name] for name in ("hg-dagger", "hg-dagger-m10", "hg-dagger-trunks", "hg-dagger-warm", "hg-dagger-warm-m10")
)
FLOORS = tuple(METHODS[name] for name in ("cloning", "switching"))  # no interaction, no learning
