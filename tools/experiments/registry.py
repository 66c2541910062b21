"""The one list of experiments, and the door to a user's own.

Without heavy imports: a module is loaded when its experiment is asked for.
"""

import importlib
from typing import TYPE_CHECKING, NamedTuple

from lira.hal.errors import ConfigError
from lira.hal.plugins import EXPERIMENTS

if TYPE_CHECKING:
    from lira.tools.experiments.experiment import Experiment


class Entry(NamedTuple):
    """What an experiment shows, and the module of `tools.experiments` whose `EXPERIMENTS` holds it."""

    words: str
    module: str


REGISTRY = {
    "unseen": Entry(
        "what it takes to pass 90 and 97 % of layouts that nobody has taught: curves, at equal quality", "unseen"
    ),
    "table2": Entry("LIRA-SPF and HG-DAgger on line-obstacles (Table II)", "compare"),
    "race": Entry("the same on the 120 m race with 21 boxes (fig. 11, 12)", "compare"),
    "tableC1": Entry("activation thresholds on the figure-eight, redundancy filter off (Table C.1)", "thresholds"),
    "tableC2": Entry("activation and redundancy thresholds on the figure-eight (Table C.2)", "thresholds"),
    "table1": Entry("the passage's experts trained from scratch, then its novice (Table I)", "table1"),
    "fig7": Entry("the passage that the camera alone sees closed: novices and experts (fig. 5, 7)", "passage"),
    "table3": Entry("one training lap through the corridor, on the twin of the real robot (Table III)", "corridor"),
    "tableD1": Entry("shared feedback, fixed and flexible, on the figure-eight with boxes (Table D.1)", "sharing"),
    "labels": Entry("densities of the labels of the race by source (fig. E.4, E.5)", "densities"),
    "trajectories": Entry("the final novices' drives on the race (fig. E.6)", "trajectories"),
    "teacher": Entry("perfect, skilled and unskilled teachers, and one fault at a time", "faults"),
    "ablation": Entry(
        "what each part of plus is worth at equal quality, with other experts than it was chosen on", "worth"
    ),
    "variants": Entry("the experts' trunks, mirrored inputs, a stop in doubt: each against its base", "worth"),
}


def load(name: str) -> "Experiment":
    """Import an experiment: one of the registry, or a user's own.

    Raises `ConfigError` for a name that is none, and `PluginError` for one that does not load.
    """
    from lira.tools.experiments.experiment import Experiment

    found = EXPERIMENTS.find(name, REGISTRY)
    if isinstance(found, Entry):
        found = importlib.import_module(f"lira.tools.experiments.studies.{found.module}").EXPERIMENTS[name]
    if not isinstance(found, Experiment):
        what = f"the experiment '{name}' is a {type(found).__name__}"
        raise ConfigError(what, "Give a lira.tools.experiments.experiment.Experiment.")
    return found


def words_of(name: str, experiment: "Experiment") -> str:
    """Say in a line what an experiment shows."""
    return REGISTRY[name].words if name in REGISTRY else experiment.words
