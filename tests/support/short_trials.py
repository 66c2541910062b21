"""Real trials that take seconds: six metres of line, one box, a teacher without faults, one lap."""

import msgspec
from short_worlds import FOR_TRIALS

from lira.fusion.methods.lira import PRESETS
from lira.fusion.methods.rivals.hg_dagger import HgDaggerSettings
from lira.fusion.teaching.teacher import PERFECT
from lira.tools.experiments.trial import Preset, Trial


def write_world(folder):
    path = folder / "short.toml"
    path.write_text(FOR_TRIALS)
    return str(path)


def short_trial(world, *, seed=0, name="hold", lira=PRESETS["hold"]):
    method = Preset(name, lira or HgDaggerSettings())
    return Trial(method, world, seed, teacher="perfect", skill=PERFECT, laps=1, unseen=1)


def timeless(outcome):
    """An outcome without what the wall clock adds."""
    laps = tuple(msgspec.structs.replace(lap, elapsed_s=0.0) for lap in outcome.laps)
    return msgspec.structs.replace(
        outcome, laps=laps, result=msgspec.structs.replace(outcome.result, elapsed_s=0.0), fingerprint=""
    )
