"""From what was on the bus to steps: each decision, with what the robot sensed and what its wheels got. Pure.

A step is a decision of `lira/decision`. Its sensors are the newest that had been measured by then and were not stale,
as in an `Observation`, and `applied` is the last that the wheels got before the next decision. Episodes are whole laps,
whoever drove and whatever was learned from them; where the robot is put down after a crash another begins. Pictures are
named by their number: a run's do not fit into memory.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import count
from typing import Any, Protocol

from lira.hal.bus.topics import APPLIED, CAMERA, DECISION, DEPTH, METHOD, ODOM, SCAN, Topic
from lira.hal.clock import is_fresh
from lira.hal.messages import Applied, CallName, Decision, Driver, LaserScan, Odometry, Phase

KEPT = 32  # of each sensor: a decision is told a period after what it was made on
BREAK_S = 2.0  # a longer silence is the end of an episode
SENSORS: tuple[Topic[Any], ...] = (SCAN, ODOM, CAMERA, DEPTH)
TOPICS: tuple[Topic[Any], ...] = (DECISION, APPLIED, METHOD, *SENSORS)  # what steps are made of


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
    """One decision. What was not there, or stale, is None; `in_buffer`: its label is learned from; `begins`: the robot
    was put down before it.

    `picture` and `depth` are numbers of pictures in the recording, each counted from 0.
    """

    decision: Decision
    scan: LaserScan | None
    odom: Odometry | None
    picture: int | None
    depth: int | None
    applied: Applied | None
    in_buffer: bool = False
    begins: bool = False

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


class _Newest:
    """The last values of a sensor, each with its time."""

    def __init__(self, topic: Topic[Any]) -> None:
        self._max_age_s = topic.max_age_s
        self._values: deque[tuple[float, Any]] = deque(maxlen=KEPT)

    def hear(self, stamp_s: float, value: Any) -> None:
        """Note a value."""
        self._values.append((stamp_s, value))

    def at(self, now_s: float) -> Any:
        """Return what had been measured by then; None if that was stale, or nothing."""
        measured = [each for each in self._values if each[0] <= now_s]
        stamp_s, value = max(measured, key=lambda each: each[0], default=(-math.inf, None))
        return value if is_fresh(stamp_s, now_s, self._max_age_s) else None


def steps_of(messages: Iterable[Heard]) -> Iterator[ExportStep]:
    """Yield the steps of a recording, in the order in which they were decided.

    Whether a step is learned from is told by the counts that decisions carry; `tools.export.buffer` knows it better.
    """
    senses = {topic.key: _Newest(topic) for topic in SENSORS}
    waiting: ExportStep | None = None
    applied: Applied | None = None
    begins = False
    numbers = {CAMERA.key: count(), DEPTH.key: count()}
    for each in messages:
        if each.key in numbers:
            senses[each.key].hear(each.message.stamp_s, next(numbers[each.key]))
        elif each.key in senses:
            senses[each.key].hear(each.message.stamp_s, each.message)
        elif each.key == APPLIED.key:
            applied = each.message
        elif each.key == METHOD.key:
            begins |= any(call.name == CallName.RESET for call in each.message.calls)
        elif each.key == DECISION.key:
            decision = each.message
            if waiting is not None:
                yield replace(waiting, applied=applied)
            stored = waiting is not None and _grew(waiting.decision, decision)
            scan, odom, picture, depth = (senses[topic.key].at(decision.stamp_s) for topic in SENSORS)
            waiting = ExportStep(decision, scan, odom, picture, depth, None, stored, begins)
            applied, begins = None, False
    if waiting is not None:
        yield replace(waiting, applied=applied)


def _grew(before: Decision, now: Decision) -> bool:
    """Whether more labels are stored than at the decision before."""
    return _stored(now) > _stored(before)


def _stored(decision: Decision) -> int:
    labels = decision.labels
    return labels.stored_human + labels.stored_expert + labels.demonstration


def episodes_of(steps: Iterable[ExportStep]) -> Iterator[ExportEpisode]:
    """Yield laps: another phase or lap, a robot put down anew, a silence or a clock that runs back begins the next."""
    lap: list[ExportStep] = []
    for step in steps:
        if lap and (step.begins or _apart(lap[-1].decision, step.decision)):
            yield ExportEpisode(tuple(lap))
            lap = []
        lap.append(step)
    if lap:
        yield ExportEpisode(tuple(lap))


def _apart(before: Decision, now: Decision) -> bool:
    passed_s = now.stamp_s - before.stamp_s
    return (before.phase, before.lap) != (now.phase, now.lap) or not 0.0 < passed_s <= BREAK_S
