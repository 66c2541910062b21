"""From what was on the bus to steps: each decision, with what the robot sensed and what its wheels got. Pure.

A step is a decision of `lira/decision`. Its sensors are the newest that had been measured by then and were not stale,
as in an `Observation`, and `applied` is the last that the wheels got before the next decision. Episodes are whole laps,
whoever drove and whatever was learned from them.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Protocol

from lira.hal.bus.sensors import SENSORS, Stamped, observation_of
from lira.hal.bus.topics import APPLIED, DECISION, Topic
from lira.hal.messages import Applied, Decision, Driver, Observation, Phase

KEPT = 32  # of each sensor: a decision is told a period after what it was made on
BREAK_S = 2.0  # a longer silence is the end of an episode
_SENSORS = {sensor.topic.key: sensor for sensor in SENSORS}
TOPICS: tuple[Topic[Any], ...] = (DECISION, APPLIED, *(sensor.topic for sensor in SENSORS))  # what steps are made of


class Heard(Protocol):
    """A message of a recording (`tools.recording.reader.Recorded`)."""

    @property
    def key(self) -> str:
        """Its topic, below the robot's name."""

    @property
    def message(self) -> Any:
        """What it says."""


@dataclass(frozen=True, slots=True)
class ExportStep:
    """One decision. `applied` is None if nothing was heard of the wheels; `in_buffer`: its label is learned from."""

    decision: Decision
    observation: Observation
    applied: Applied | None
    in_buffer: bool = False

    @property
    def intervention(self) -> bool:
        """Whether a person drove."""
        return self.decision.driver == Driver.HUMAN


@dataclass(frozen=True, slots=True)
class ExportEpisode:
    """One lap, or as much of it as was recorded."""

    steps: tuple[ExportStep, ...]

    @property
    def phase(self) -> Phase:
        """What it was driven for."""
        return self.steps[0].decision.phase


class _Senses:
    """The last values of every sensor."""

    def __init__(self) -> None:
        self._values: dict[str, deque[Stamped]] = {sensor.name: deque(maxlen=KEPT) for sensor in SENSORS}

    def hear(self, key: str, value: Stamped) -> None:
        """Note a value."""
        self._values[_SENSORS[key].name].append(value)

    def at(self, seq: int, stamp_s: float) -> Observation:
        """Return what had been measured by then."""
        newest = {
            name: max((each for each in values if each.stamp_s <= stamp_s), key=_stamp, default=None)
            for name, values in self._values.items()
        }
        return observation_of(seq, stamp_s, newest)


def _stamp(value: Stamped) -> float:
    return value.stamp_s


def steps_of(messages: Iterable[Heard]) -> Iterator[ExportStep]:
    """Yield the steps of a recording, in the order in which they were decided.

    Whether a step is learned from is told by the counts that decisions carry; `tools.export.buffer` knows it better.
    """
    senses, waiting, applied = _Senses(), None, None
    for each in messages:
        if each.key in _SENSORS:
            senses.hear(each.key, each.message)
        elif each.key == APPLIED.key:
            applied = each.message
        elif each.key == DECISION.key:
            decision = each.message
            if waiting is not None:
                yield _done(waiting, applied)
            stored = waiting is not None and _grew(waiting.decision, decision)
            observation = senses.at(decision.observation, decision.stamp_s)
            waiting, applied = ExportStep(decision, observation, None, stored), None
    if waiting is not None:
        yield _done(waiting, applied)


def _done(step: ExportStep, applied: Applied | None) -> ExportStep:
    return replace(step, applied=applied)


def _grew(before: Decision, now: Decision) -> bool:
    """Whether more labels are stored than at the decision before."""
    return _stored(now) > _stored(before)


def _stored(decision: Decision) -> int:
    labels = decision.labels
    return labels.stored_human + labels.stored_expert + labels.demonstration


def episodes_of(steps: Iterable[ExportStep]) -> Iterator[ExportEpisode]:
    """Yield laps: another phase or lap, a silence or a clock that runs back begins the next."""
    lap: list[ExportStep] = []
    for step in steps:
        if lap and _apart(lap[-1].decision, step.decision):
            yield ExportEpisode(tuple(lap))
            lap = []
        lap.append(step)
    if lap:
        yield ExportEpisode(tuple(lap))


def _apart(before: Decision, now: Decision) -> bool:
    passed_s = now.stamp_s - before.stamp_s
    return (before.phase, before.lap) != (now.phase, now.lap) or not 0.0 < passed_s <= BREAK_S or math.isnan(passed_s)
