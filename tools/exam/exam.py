"""Lets a policy drive layouts of a world alone, as fast as the machine can, and says how it went."""

from collections.abc import Iterable
from dataclasses import dataclass

from lira.fusion.experts.load import load_alone
from lira.fusion.experts.tasks import task_of
from lira.fusion.inference.threads import one_thread
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord, Record
from lira.fusion.methods.base import Expert, Policy
from lira.hal.errors import ConfigError
from lira.hal.profile import RobotProfile
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.world import World
from lira.tools.output.proven import share, unseen_words
from lira.tools.runs.course import Course, show_alone
from lira.tools.runs.simulated import simulate


@dataclass(frozen=True, slots=True)
class Exam:
    """How a policy drove: a lap on each layout. It prints as a line for each, and the sum."""

    laps: tuple[LapRecord, ...]

    @property
    def passed(self) -> int:
        """How many layouts it passed: to the end in time, without a collision and without losing the line."""
        return sum(lap.passed for lap in self.laps)

    @property
    def rate(self) -> float:
        """The share of layouts that it passed."""
        return self.passed / len(self.laps)

    @property
    def surely(self) -> float:
        """Which rate so few laps make sure of: the lower end of the 95 % interval."""
        return share(self.passed, len(self.laps))[0]

    def require(self, floor: float) -> None:
        """Raise `AssertionError`, with what went wrong where, if it passed a smaller share than `floor`."""
        if self.rate < floor:
            raise AssertionError(f"it passed {self.rate:.0%} of the layouts, less than {floor:.0%}\n{self}")

    def __str__(self) -> str:
        return "\n".join([*map(_lap_words, self.laps), unseen_words(self.laps)])


def examine(
    policy: str | Expert | Policy,
    world: str | World,
    profile: str | RobotProfile | None = None,
    *,
    layouts: Iterable[int] = range(1, 11),
    seed: int = 0,
    experts: str | None = None,
    shield: bool = False,
) -> Exam:
    """Let a policy drive these layouts; the same numbers give the same laps.

    `policy` is a name, a .safetensors file, MODULE:OBJECT, a function of `Features` or an `Expert`. Raises
    `ConfigError` for a name that is none, or no layouts.
    """
    chosen = tuple(layouts)
    if not chosen:
        raise ConfigError("there is no layout to drive", "Give some: layouts=range(1, 11).")
    one_thread()  # a result should not depend on the number of cores
    place = load_world(world) if isinstance(world, str) else world
    laps: list[LapRecord] = []

    def note(record: Record) -> None:
        if isinstance(record, LapRecord):
            laps.append(record)

    with simulate(place, profile, layout=chosen[0], seed=seed) as robot:
        method = load_alone(policy, robot.profile, experts or task_of(place.name), shield=shield)
        course = Course(robot.profile, place, unseen=chosen)
        show_alone(robot, robot.arena, method, Journal(write=note), course)
    return Exam(tuple(laps))


def _lap_words(lap: LapRecord) -> str:
    how = "passed" if lap.passed else "failed"
    return f"layout {lap.layout}: {how} after {lap.duration_s:.1f} s; collisions {lap.collisions}, lost {lap.lost}"
