"""What a study is, from a TOML file."""

from pathlib import Path
from typing import Annotated

from msgspec import Meta

from lira.hal.config import Table, load_toml
from lira.hal.errors import ConfigError

Words = Annotated[str, Meta(min_length=1, max_length=4000)]
FEWEST, MOST = 2, 8


class StudyPlan(Table, frozen=True):
    """A study within subjects: everybody teaches by every method.

    A block ends after `minutes`, or, with `until_passed`, when the novice has passed its proof, but no later than that.
    `questions` are asked in free words after each block, beside the NASA-TLX.
    """

    title: Words
    consent: Words
    methods: Annotated[tuple[str, ...], Meta(min_length=FEWEST, max_length=MOST)]
    participants: Annotated[int, Meta(ge=1, le=1000)] = 12
    world: str = "line-obstacles"
    layout: Annotated[int, Meta(ge=0)] = 0
    seed: Annotated[int, Meta(ge=0)] = 0
    practice_s: Annotated[float, Meta(ge=0.0, le=600.0)] = 30.0
    minutes: Annotated[float, Meta(gt=0.0, le=240.0)] = 15.0
    until_passed: bool = True
    unseen: Annotated[int, Meta(ge=0, le=80)] = 12
    speed: Annotated[float, Meta(ge=0.4, le=5.0)] = 1.0
    questions: tuple[Words, ...] = ()

    def __post_init__(self) -> None:
        """Check what no single field can. Raises `ValueError`, which loading turns into a `ConfigError`."""
        if len(set(self.methods)) < len(self.methods):
            raise ValueError("a method is there twice")


def load_plan(path: Path) -> StudyPlan:
    """Load a plan. Raises `ConfigError`, also for a method that there is none of or by which nobody learns."""
    from lira.fusion.methods.presets import method_named
    from lira.sim_backend.catalogue import load_world

    plan = load_toml(path, StudyPlan)
    load_world(plan.world)
    for name in plan.methods:
        if not method_named(name).approach.learns:
            raise ConfigError(f"by the method '{name}' nobody learns", f"Take it out of {path}.")
    return plan
