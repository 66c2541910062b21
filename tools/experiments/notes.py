"""What a trial is remembered by, taken down while it goes on."""

from collections.abc import Sequence
from typing import Self

import msgspec

from lira.fusion.log.counts import DEMONSTRATION
from lira.fusion.log.label_log import Demonstration
from lira.fusion.log.run_log import LapRecord, Record, StepRecord
from lira.hal.messages import Action, Driver, Phase


class Track(msgspec.Struct, frozen=True):
    """Where one lap went, decision by decision; whole millimetres keep it small."""

    phase: Phase
    lap: int
    layout: int
    x_mm: tuple[int, ...]
    y_mm: tuple[int, ...]
    speed_mm_s: tuple[int, ...]
    drivers: tuple[str, ...]

    @classmethod
    def of(cls, steps: Sequence[StepRecord]) -> Self:
        """Take over what is drawn of one lap's steps."""
        poses = [step.state for step in steps if step.state is not None]
        first = steps[0]
        return cls(
            first.decision.phase,
            first.decision.lap,
            first.layout,
            tuple(round(1000 * pose.x_m) for pose in poses),
            tuple(round(1000 * pose.y_m) for pose in poses),
            tuple(round(1000 * pose.linear_m_s) for pose in poses),
            tuple(step.decision.driver for step in steps),
        )


class Notes:
    """Takes down what a trial is to be remembered by, while it goes on."""

    def __init__(self) -> None:
        self.laps: list[LapRecord] = []
        self._tracks: list[Track] = []
        self._steps: list[StepRecord] = []
        self._label: Demonstration | None = None
        self._labels: dict[str, list[Action]] = {}

    def label(self, label: Demonstration) -> None:
        """Note a label; the record of its step follows."""
        self._label = label if label.stored else None

    def record(self, record: Record) -> None:
        """Note a step or the end of a lap."""
        if isinstance(record, StepRecord):
            self._steps.append(record)
            if self._label is not None:
                self._labels.setdefault(source(record), []).append(rounded(self._label.action))
                self._label = None
        elif isinstance(record, LapRecord):
            self.laps.append(record)
            if self._steps:
                self._tracks.append(Track.of(self._steps))
            self._steps = []

    @property
    def labels(self) -> dict[str, tuple[Action, ...]]:
        """Actions of the stored labels by source, as in `Account`."""
        return {source: tuple(actions) for source, actions in self._labels.items()}

    @property
    def tracks(self) -> tuple[Track, ...]:
        """The first training lap and everything from the last one on."""
        last = max((track.lap for track in self._tracks if track.phase == Phase.TRAIN), default=0)
        return tuple(track for track in self._tracks if track.phase == Phase.UNSEEN or track.lap in (1, last))


def source(record: StepRecord) -> str:
    """Who gave the label of a step, as in `Account`."""
    driver = record.decision.driver
    return DEMONSTRATION if driver == Driver.HUMAN and record.decision.training_steps == 0 else driver


def rounded(action: Action) -> Action:
    """Three decimals are enough for a density."""
    linear, angular = action
    return round(linear, 3), round(angular, 3)
