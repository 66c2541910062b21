"""Episodes as columns of numbers and words: the one table that all formats are written from. Pure.

| column | what it is |
|---|---|
| `observation.state` | linear and angular velocity by odometry, m/s and rad/s |
| `observation.environment_state` | the scan as networks see it: nearest return in each direction ahead, in [0, 1] |
| `action` | what was driven, whoever did: linear and angular in [-1, 1], fractions of the robot's limits |
| `applied` | what the wheels got, m/s and rad/s; nan if nobody heard |
| `intervention` | whether a person drove |
| `source` | who did: human, novice, mean, shield, an expert's name, none |
| `novice.action`, `experts.NAME.action`, `.activation`, `.active` | what each proposed; nan for one that is not there |
| `threshold` | an expert is active from this activation on |
| `call` | how the person was called: none, attention, feedback |
| `policy_version` | training steps of the novice so far |
| `in_buffer` | whether the step's label is learned from |
| `phase`, `lap` | train, prove or unseen, and which lap |
| `observation_number`, `stamp_s` | which observation, and when, on the robot's clock |
| `complete` | whether every sensor was there; else the last value stands in |

Pictures are no column: `tools.export.pictures` tells them one by one.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from lira.fusion.modalities.scan import bin_scan
from lira.hal.errors import SensorError
from lira.hal.messages import Action, FloatArray
from lira.hal.profile import RobotProfile
from lira.tools.export.steps import ExportEpisode, ExportStep

T = TypeVar("T")
UNUSUAL = re.compile(r"[^\w:.-]")  # a slash has a meaning of its own for others
SCAN = "observation.environment_state"
VELOCITY = ("linear", "angular")
NAN: Action = (math.nan, math.nan)
Kind = Literal["float32", "float64", "int64", "bool", "string"]


@dataclass(frozen=True, slots=True)
class Column:
    """Values by step: [n], or [n, len(names)] where its components have names."""

    name: str
    kind: Kind
    values: NDArray[Any]
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Table:
    """An episode and its columns."""

    episode: ExportEpisode
    columns: tuple[Column, ...]

    def __len__(self) -> int:
        return len(self.episode.steps)

    def __getitem__(self, name: str) -> Column:
        return next(column for column in self.columns if column.name == name)


def tables_of(episodes: Sequence[ExportEpisode], profile: RobotProfile) -> list[Table]:
    """Return a table for each episode, all with the same columns."""
    experts = sorted({view.name for each in episodes for step in each.steps for view in step.decision.experts})
    return [Table(each, _columns(each.steps, experts, profile)) for each in episodes]


def _columns(steps: Sequence[ExportStep], experts: Sequence[str], profile: RobotProfile) -> tuple[Column, ...]:
    decisions = [step.decision for step in steps]
    scans, states = [_scan(step, profile) for step in steps], [_state(step) for step in steps]
    bins = profile.features.bins
    seen = [step.picture is not None and (step.depth is not None or profile.depth is None) for step in steps]
    there = [scan is not None and state is not None for scan, state in zip(scans, states, strict=True)]
    return (
        _vector("observation.state", VELOCITY, _filled(states, (0.0, 0.0))),
        _vector(SCAN, tuple(f"bin_{number}" for number in range(bins)), _filled(scans, np.ones(bins, np.float32))),
        _vector("action", VELOCITY, [each.executed for each in decisions]),
        _vector("applied", VELOCITY, [_applied(step) for step in steps]),
        _scalar("intervention", "bool", [step.intervention for step in steps]),
        _scalar("source", "string", [each.driver for each in decisions]),
        _vector("novice.action", VELOCITY, [each.novice for each in decisions]),
        *(column for name in experts for column in _expert(name, steps)),
        _scalar("threshold", "float32", [each.threshold for each in decisions]),
        _scalar("call", "string", [each.call.value for each in decisions]),
        _scalar("policy_version", "int64", [each.training_steps for each in decisions]),
        _scalar("in_buffer", "bool", [step.in_buffer for step in steps]),
        _scalar("phase", "string", [each.phase.value for each in decisions]),
        _scalar("lap", "int64", [each.lap for each in decisions]),
        _scalar("observation_number", "int64", [each.observation for each in decisions]),
        _scalar("stamp_s", "float64", [each.stamp_s for each in decisions]),
        _scalar("complete", "bool", [a and b for a, b in zip(there, seen, strict=True)]),
    )


def _expert(name: str, steps: Sequence[ExportStep]) -> tuple[Column, ...]:
    column = f"experts.{UNUSUAL.sub('_', name)}"
    views = [next((view for view in step.decision.experts if view.name == name), None) for step in steps]
    return (
        _vector(f"{column}.action", VELOCITY, [NAN if view is None else view.action for view in views]),
        _scalar(f"{column}.activation", "float32", [math.nan if v is None else v.activation for v in views]),
        _scalar(f"{column}.active", "bool", [view is not None and view.active for view in views]),
    )


def _scalar(name: str, kind: Kind, values: Sequence[Any]) -> Column:
    return Column(name, kind, np.array(values, object if kind == "string" else kind))


def _vector(name: str, names: tuple[str, ...], values: Sequence[Any]) -> Column:
    return Column(name, "float32", np.array(values, np.float32).reshape(-1, len(names)), names)


def _filled(values: Sequence[T | None], otherwise: T) -> list[T]:
    """Put the value before, else the next, else another one, where there is none."""
    known = next((value for value in values if value is not None), otherwise)
    filled = []
    for value in values:
        known = known if value is None else value
        filled.append(known)
    return filled


def _state(step: ExportStep) -> Action | None:
    odom = step.odom
    return None if odom is None else (odom.linear_m_s, odom.angular_rad_s)


def _applied(step: ExportStep) -> Action:
    return NAN if step.applied is None else (step.applied.twist.linear_m_s, step.applied.twist.angular_rad_s)


def _scan(step: ExportStep, profile: RobotProfile) -> FloatArray | None:
    """The scan in bins; None for one that is absent or that nobody could use."""
    if step.scan is None:
        return None
    try:
        return bin_scan(step.scan, profile.features)[0]
    except SensorError:
        return None
