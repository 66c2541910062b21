"""What an experiment is: trials to run and, of what came of them, tables, figures and findings.

A new experiment is a module with `EXPERIMENTS = {name: Experiment(...)}` and a line in `registry`; one of your own lies
where you like, and `lira experiment MODULE:OBJECT` plays it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from lira.tools.experiments.trial import Outcome, Trial

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Row = dict[str, object]
"""One row of a table: column name to value; None or a missing column is an empty cell."""


@dataclass(frozen=True, slots=True)
class Table:
    """A table with the thesis's rows or columns beside ours. `note` says how to read it."""

    title: str
    rows: list[Row]
    note: str = ""


@dataclass(frozen=True, slots=True)
class Finding:
    """One statement of the thesis held against our numbers.

    `key` is unique among all experiments and finds the likely cause of a difference in `causes.toml`.
    `thesis` and `ours` are the numbers in words; `agrees` is computed from them by the experiment.
    """

    key: str
    claim: str
    thesis: str
    ours: str
    agrees: bool


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawing by matplotlib, made when it is needed; `words` is its caption."""

    name: str
    words: str
    draw: Callable[[], "Figure"]


Outcomes = Sequence[Outcome]


@dataclass(frozen=True, slots=True)
class Experiment:
    """The same shape for every experiment. All but `trials` are pure functions of the outcomes.

    `trials(seeds)` lists what is run for seeds 0, 1, ... `seeds - 1`. `ratios` are rows of `method`, `against`,
    `quantity`, `median`, `low`, `high`, `n`, `censored`, for experiments that compare methods pair by pair, and
    `quality` rows of `method`, `pair`, effort and unseen laps passed, for those that ask how good the novices are;
    `curves` rows of `method`, `quantity`, `at`, `share`, `collisions_100m`, for those that say how they came to be so.
    `methods` are those of which some may be played alone, and `usual` those that are if nothing is said; none where
    only all together say something. `words` says what it shows, where the registry does not.
    """

    trials: Callable[[int], list[Trial]]
    tables: Callable[[Outcomes], list[Table]]
    findings: Callable[[Outcomes], list[Finding]]
    figures: Callable[[Outcomes], list[Picture]] = lambda _: []
    ratios: Callable[[Outcomes], list[Row]] = lambda _: []
    quality: Callable[[Outcomes], list[Row]] = lambda _: []
    curves: Callable[[Outcomes], list[Row]] = lambda _: []
    methods: tuple[str, ...] = ()
    usual: tuple[str, ...] = ()
    words: str = ""
