"""Which trials of an experiment are played: which methods, with whose experts, where, by which teacher."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from msgspec.structs import replace

from lira.fusion.methods.presets import method_named
from lira.fusion.teaching.teacher import TEACHERS
from lira.hal.errors import ConfigError
from lira.hal.words import plural
from lira.sim_backend.shifts import SHIFTS
from lira.tools.experiments.experiment import Experiment
from lira.tools.experiments.quality import WAYS, Way
from lira.tools.experiments.trial import Trial

ALL = "all"
KERNEL = "kernel"  # plus, and every other method with its novice
AT_EQUAL_QUALITY = {  # what is asked there alone, and the option that asks it
    "world": "--world",
    "teacher": "--teacher",
    "shift": "--shift",
    "randomised": "--randomise",
    "laps": "--laps",
    "more": "--more",
    "ways": "--ways",
}


@dataclass(frozen=True, slots=True)
class Selection:
    """What is asked for. `methods` is a list with commas, "all", "kernel", or None for the usual ones; `own` a user's.

    `pairs` of experts replace the world's; `world`, `teacher`, `shift`, whether the world is `randomised` while it is
    taught, the cap of `laps`, `more` laps and `ways` of deployment go with experiments at equal quality.
    """

    seeds: int
    first_seed: int = 0
    methods: str | None = None
    own: Sequence[str] = ()
    pairs: Sequence[str] = ()
    world: str | None = None
    teacher: str | None = None
    shift: str | None = None
    randomised: bool = False
    laps: int | None = None
    more: int = 0
    ways: Sequence[Way] = ()
    all_experiments: bool = field(default=False, kw_only=True)

    def trials(self, experiment: Experiment, name: str) -> list[Trial]:
        """Return the trials that are asked for. Raises `ConfigError` for what the experiment does not know."""
        listed = experiment.trials(self.seeds)
        methods = ALL if self.all_experiments and experiment.methods else self.methods
        chosen = chosen_methods(methods, experiment, name)
        trials = [trial for trial in listed if not chosen or trial.method.name in chosen]
        if self.own:
            trials += own_trials(self.own, listed, experiment, name)
        trials = [replace(each, seed=self.first_seed + each.seed) for each in trials]
        trials = [self._elsewhere(each, name) for each in trials]
        if self.pairs:
            if not self.all_experiments and all(trial.experts for trial in trials):
                raise ConfigError(f"{name} takes no --experts", "It is played with experts of its own choice.")
            trials = [replace(each, experts=each.experts or pair) for each in trials for pair in self.pairs]
            trials = list(dict.fromkeys(trials))
        return trials

    @property
    def command(self) -> str:
        """What was asked for, as it is typed."""
        words = [f"--seeds {self.seeds}"]
        words += [f"--methods {self.methods}"] if self.methods is not None else []
        words += [f"--first-seed {self.first_seed}"] if self.first_seed else []
        words += [f"--experts {','.join(self.pairs)}"] if self.pairs else []
        words += [f"--method {each}" for each in self.own]
        words += [f"--world {self.world}"] if self.world is not None else []
        words += [f"--teacher {self.teacher}"] if self.teacher is not None else []
        words += [f"--shift {self.shift}"] if self.shift is not None else []
        words += ["--randomise"] if self.randomised else []
        words += [f"--laps {self.laps}"] if self.laps is not None else []
        words += [f"--more {self.more}"] if self.more else []
        words += [f"--ways {','.join(self.ways)}"] if self.ways else []
        return " ".join(words)

    @property
    def elsewhere(self) -> str:
        """What to add to an experiment's name where it is not what it is by itself."""
        parts = (
            KERNEL if self.methods == KERNEL else None,
            self.world and Path(self.world).stem,
            self.teacher,
            "randomised" if self.randomised else None,
            self.shift,
            f"more{self.more}" if self.more else None,
            "ask" if "ask" in self.ways else None,  # which takes as long as all else together
        )
        return "".join(f"-{part}" for part in parts if part)

    def _elsewhere(self, trial: Trial, name: str) -> Trial:
        asked = [option for asks, option in AT_EQUAL_QUALITY.items() if getattr(self, asks)]
        if not asked:
            return trial
        if trial.quality is None:
            raise ConfigError(
                f"{name} takes no {' and no '.join(asked)}", "'unseen' and other experiments at equal quality do."
            )
        teacher = self.teacher or trial.teacher
        if teacher not in TEACHERS:
            raise ConfigError(f"no teacher '{teacher}'", f"Teachers: {', '.join(TEACHERS)}.")
        if self.shift is not None and self.shift not in SHIFTS:
            raise ConfigError(f"no shift '{self.shift}'", f"Shifts: {', '.join(SHIFTS)}.")
        ways = tuple(self.ways) or trial.quality.ways
        if not set(ways) <= set(WAYS):
            raise ConfigError(f"no way of deployment '{min(set(ways) - set(WAYS))}'", f"Ways: {', '.join(WAYS)}.")
        laps, most = self.laps or trial.laps, trial.method.syllabus.most_laps
        if not 0 < laps + self.more <= most:
            what = f"{plural(laps, 'lap')} and {self.more} more are more than there are fresh layouts for"
            raise ConfigError(what, f"Give --laps and --more of {most} together.")
        return replace(
            trial,
            world=self.world or trial.world,
            teacher=teacher,
            skill=TEACHERS[teacher],
            laps=laps,
            quality=replace(trial.quality, shift=self.shift, more=self.more, ways=ways, randomised=self.randomised),
        )


def own_trials(names: Sequence[str], listed: Sequence[Trial], experiment: Experiment, name: str) -> list[Trial]:
    """Return the trials of methods of one's own: those of one that is known, on its layouts and with its proof."""
    if not experiment.methods:
        raise ConfigError(f"{name} takes no --method", "It needs all of its methods together.")
    like = [trial for trial in listed if trial.method.name == experiment.methods[0]]
    return [
        replace(trial, method=replace(method_named(own), syllabus=trial.method.syllabus))
        for own in names
        for trial in like
    ]


def chosen_methods(words: str | None, experiment: Experiment, name: str) -> set[str]:
    """Return the methods that were asked for, or the usual ones; nothing where there is no choice.

    Raises `ConfigError`.
    """
    known = experiment.methods
    if words is None:
        return set(experiment.usual)
    if not known:
        raise ConfigError(f"{name} takes no --methods", "It needs all of its methods together.")
    if words == ALL:
        return set(known)
    chosen = set(words.split(","))
    if KERNEL in chosen:
        chosen = chosen - {KERNEL} | {each for each in known if each == "plus" or each.endswith("-kernel")}
    if not chosen <= set(known):
        remedy = f"Known: {', '.join(known)}; or {KERNEL}, or {ALL}."
        raise ConfigError(f"{name} has no method '{min(chosen - set(known))}'", remedy)
    return chosen
