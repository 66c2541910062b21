"""What is to be taught, and how: by a script, by a person, or once more from a recording."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import msgspec

from lira.fusion.learning.trainer import NewTrainer
from lira.fusion.log.method_trace import traced
from lira.fusion.log.run_log import RunRecord
from lira.fusion.methods.base import Expert, Method, Policy
from lira.fusion.methods.context import Context
from lira.fusion.methods.presets import Preset
from lira.hal.profile import RobotProfile
from lira.tools.cli import version
from lira.tools.runs.build import build_method
from lira.tools.runs.progress import Publish


@dataclass(frozen=True, slots=True)
class Plan:
    """What is to be taught, and how. `pair` says whose experts (those of the world's task), `more` adds own ones.

    `build` builds the method where the preset's name does not say how. `folder` keeps labels, record and novice;
    `command` repeats the run. `shield` is for the unseen layouts, and for what drives afterwards.
    """

    preset: Preset
    layout: int = 0
    seed: int = 0
    laps: int = 12
    unseen: int = 3
    teacher: str = "scripted"
    pair: str | None = None
    more: Sequence[str | Expert | Policy] = ()
    build: Callable[[Context], Method] | None = None
    folder: Path | None = None
    command: str = ""
    shield: bool = False

    def head(self, profile: RobotProfile, world: str) -> RunRecord:
        """Return the head of the run's record."""
        preset = self.preset
        idle = preset.learning.idle_frames
        return RunRecord(
            world, profile.name, preset.kind, preset.name, self.layout, self.seed, self.command, version(), idle
        )


class Recipe(msgspec.Struct, frozen=True):
    """What a method was built from, as far as it can be written down. `missing` says what cannot, "" if it is all."""

    preset: Preset
    seed: int
    pair: str
    more: tuple[str, ...] = ()
    missing: str = ""

    @classmethod
    def of(cls, plan: Plan, pair: str) -> Self:
        """Write down what a plan builds."""
        named = tuple(each for each in plan.more if isinstance(each, str))
        missing = "" if plan.build is None else "the method is an object of the program that taught it"
        if len(named) < len(plan.more):
            missing = "an expert is an object of the program that taught the method"
        return cls(plan.preset, plan.seed, pair, named, missing)


def build_traced(plan: Plan, profile: RobotProfile, trainer: NewTrainer, pair: str, publish: Publish | None) -> Method:
    """Build a plan's method; `publish` gets its calls. Raises as `build_method` does."""
    method = build_method(plan.preset, profile, plan.seed, trainer, pair, plan.more, plan.build)
    return method if publish is None else traced(method, msgspec.json.encode(Recipe.of(plan, pair)), publish)
