"""The records of one run, sorted into laps: what every part of the page is drawn from."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from msgspec import structs

from lira.fusion.log.run_log import (
    EditRecord,
    LapRecord,
    Record,
    ResultRecord,
    RunRecord,
    StepRecord,
    VerdictRecord,
    read_run,
)
from lira.hal.errors import StorageError
from lira.hal.messages import Action, Driver, Phase
from lira.tools.output.lap_names import lap_name

UNTOUCHED = EditRecord()
MOMENT_S = 2.0  # a lap of training that was cut off so soon was none: somebody asked for the proof


@dataclass(frozen=True, slots=True)
class Lap:
    """The steps of one lap in order; `record` is None for a lap that was cut off, `day` for a run of one day.

    `turn` counts the proving runs after a training lap.
    """

    phase: Phase
    number: int
    layout: int
    steps: tuple[StepRecord, ...]
    record: LapRecord | None = None
    day: int | None = None
    turn: int = 1

    @property
    def title(self) -> str:
        """Name for headings: a training lap by its number, the others by what they prove."""
        name = lap_name(self.phase, self.number, self.layout, self.turn)
        return f"{name[0].upper()}{name[1:]}" if self.day is None else f"Day {self.day}: {name}"

    @property
    def began_s(self) -> float:
        """Robot time of the first step."""
        return self.steps[0].decision.stamp_s if self.steps else 0.0

    @property
    def duration_s(self) -> float:
        """Robot time from the first step to the last."""
        return self.steps[-1].decision.stamp_s - self.began_s if self.steps else 0.0


@dataclass(frozen=True, slots=True)
class Run:
    """One run: how it began, its laps, how it ended (None: it was cut off).

    Of a run that went on another day `head` is the newest, and `result` sums up the time of all days.
    """

    head: RunRecord | None
    laps: tuple[Lap, ...]
    result: ResultRecord | None
    experts: tuple[str, ...]
    verdict: VerdictRecord | None = None  # the newest of a person's session
    edited: EditRecord = UNTOUCHED  # what was done to its labels after its end

    def phase(self, name: str) -> list[Lap]:
        """Laps of one phase."""
        return [lap for lap in self.laps if lap.phase == name]

    def steps(self) -> Iterator[tuple[Lap, StepRecord]]:
        """All steps, each with its lap."""
        return ((lap, step) for lap in self.laps for step in lap.steps)

    def labels(self) -> dict[str, list[Action]]:
        """Actions of the learned labels by source: "human" and "expert" (one expert's, or the mean of several)."""
        actions: dict[str, list[Action]] = {"human": [], "expert": []}
        for _, step in self.steps():
            own = [] if step.label is None else [(step.label, step.decision.executed)]
            for source, action in (*own, *step.settled):
                actions["human" if source == Driver.HUMAN else "expert"].append(action)
        return actions


@dataclass(slots=True)
class _Sorter:
    """Collects records; a lap ends with its `LapRecord` or with the first step of another lap."""

    head: RunRecord | None = None
    result: ResultRecord | None = None
    verdict: VerdictRecord | None = None
    edited: EditRecord = UNTOUCHED
    laps: list[Lap] = field(default_factory=list)
    steps: list[StepRecord] = field(default_factory=list)
    days: int = 0
    times_s: tuple[float, float] = (0.0, 0.0)  # simulated and elapsed, of the days before

    def add(self, record: Record) -> None:
        match record:
            case RunRecord():
                self.begin_day(record)
            case StepRecord():
                if self.steps and _key(self.steps[-1]) != _key(record):
                    self.end_lap(None)
                self.steps.append(record)
            case LapRecord():
                self.end_lap(record)
            case ResultRecord():
                simulated_s, elapsed_s = self.times_s
                self.result = structs.replace(
                    record, simulated_s=record.simulated_s + simulated_s, elapsed_s=record.elapsed_s + elapsed_s
                )
            case VerdictRecord():
                self.verdict = record
            case EditRecord():
                self.edited = EditRecord(
                    self.edited.taken_back + record.taken_back, self.edited.learned_again + record.learned_again
                )

    def begin_day(self, head: RunRecord) -> None:
        """A file that was appended to holds several days."""
        self.end_lap(None)
        if self.result is not None:
            self.times_s = self.result.simulated_s, self.result.elapsed_s
        self.head, self.result, self.verdict, self.edited = head, None, None, UNTOUCHED
        self.days += 1

    def end_lap(self, record: LapRecord | None) -> None:
        if record is not None:
            phase, number, layout = record.phase, record.lap, record.layout
        elif self.steps:
            phase, number, layout = _key(self.steps[0])
        else:
            return
        ended = bool(self.laps) and self.laps[-1].record is not None
        if ended and record is None and phase == Phase.TRAIN and _lasted_s(self.steps) < MOMENT_S:
            self.steps = []
            return
        same = [lap for lap in self.laps if (lap.day, lap.phase, lap.number) == (self.days, phase, number)]
        self.laps.append(Lap(phase, number, layout, tuple(self.steps), record, self.days, len(same) + 1))
        self.steps = []


def _lasted_s(steps: Sequence[StepRecord]) -> float:
    return steps[-1].decision.stamp_s - steps[0].decision.stamp_s


def _key(step: StepRecord) -> tuple[Phase, int, int]:
    return step.decision.phase, step.decision.lap, step.layout


def digest(records: Iterable[Record]) -> Run:
    """Sort records into laps."""
    sorter = _Sorter()
    for record in records:
        sorter.add(record)
    sorter.end_lap(None)
    laps = sorter.laps if sorter.days > 1 else [replace(lap, day=None) for lap in sorter.laps]
    experts: dict[str, None] = {}
    for lap in laps:
        for step in lap.steps[:1]:
            experts |= dict.fromkeys(view.name for view in step.decision.experts)
    return Run(sorter.head, tuple(laps), sorter.result, tuple(experts), sorter.verdict, sorter.edited)


def blinded(run: Run, letter: str) -> Run:
    """The same run, of which nobody reads by which method it was taught."""
    if run.head is None:
        return run
    name = f"Method {letter}"
    return replace(run, head=structs.replace(run.head, method=name, preset=name, command=""))


def load_run(path: Path) -> Run:
    """Read and digest a run record. Raises `StorageError` where there is none or nothing in it."""
    run = digest(read_run(path))
    if run.head is None and not run.laps:
        raise StorageError(f"{path} holds no step yet", "Let the run go on for a moment, then try again.")
    return run
