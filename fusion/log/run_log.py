"""The record of a run: one JSON line per step and per result, for progress displays, tables, plots and reports.

It is a by-product and may be deleted; what was learned lives in the demonstration log.
"""

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Self

import msgspec

from lira.fusion.log.counts import Account
from lira.hal.config import MALFORMED, open_regular
from lira.hal.errors import StorageError
from lira.hal.messages import Action, CourseState, Decision, Phase

UNPROVEN = "none"  # of a run in which nobody was asked to prove anything
LINE_BYTES = 2**20  # ten times what a step with the largest picture takes


class Pose(msgspec.Struct, frozen=True):
    """Ground truth at a step, from `CourseState`; None where a world has no line or no box (JSON knows no nan)."""

    x_m: float
    y_m: float
    yaw_rad: float
    linear_m_s: float
    angular_rad_s: float
    progress_m: float | None
    lateral_m: float | None
    clearance_m: float | None
    collided: bool
    lost: bool

    @classmethod
    def of(cls, state: CourseState) -> Self:
        """Take over what a plot needs."""

        def known(value: float) -> float | None:
            return value if math.isfinite(value) else None

        return cls(
            state.x_m,
            state.y_m,
            state.yaw_rad,
            state.linear_m_s,
            state.angular_rad_s,
            known(state.progress_m),
            known(state.lateral_m),
            known(state.clearance_m),
            state.collided,
            state.lost,
        )


class StepRecord(msgspec.Struct, frozen=True, tag="step"):
    """One decision, where the robot really was, and what was learned from it.

    `label` names who gave a label that was stored at this step, else None. `settled` are those of earlier steps that
    were stored now, when that was decided: who gave each, and its action.
    `image` is what the camera showed when a call rose: uint8 [px, px] row by row, else None.
    """

    decision: Decision
    state: Pose | None = None
    layout: int = 0
    label: str | None = None
    image: bytes | None = None
    elapsed_s: float = 0.0  # wall-clock time since the run began
    settled: tuple[tuple[str, Action], ...] = ()


class LapRecord(msgspec.Struct, frozen=True, tag="lap"):
    """The end of one lap.

    `human_labels` (stored), `interventions`, `calls` and `buffer` are totals of the session so far; `passed` means: to
    the end, no collision, line never lost. `unassisted` means that no human action was needed. `stops` counts how often
    a novice that drove alone stood and asked, being in doubt; `shielded` in how many steps a shield changed its turn.
    """

    phase: Phase
    lap: int
    layout: int
    passed: bool
    unassisted: bool
    duration_s: float
    collisions: int
    lost: int
    lateral_rms_m: float | None
    human_labels: int
    interventions: int
    calls: int
    buffer: int
    training_steps: int
    elapsed_s: float
    stops: int = 0
    shielded: int = 0


class RunRecord(msgspec.Struct, frozen=True, tag="run"):
    """The head of a run: how it was started, so that it can be repeated."""

    world: str
    profile: str
    method: str
    preset: str
    layout: int
    seed: int
    command: str
    version: str
    idle_frames: str = "label"  # as in `LearningSettings`


class ContradictionRecord(msgspec.Struct, frozen=True):
    """A label that the novice does not follow, since the `others` say otherwise; `number` is its place in the log.

    `given_s` is when, on the robot's clock, as the log has it; None in older records. `mirrored`: it is followed; left
    and right exchanged it is not.
    """

    number: int
    source: str
    lap: int
    action: Action
    others: Action
    mirrored: bool = False
    given_s: float | None = None


class ResultRecord(msgspec.Struct, frozen=True, tag="result"):
    """The end of a run. `converged` is False for a run that met its cap: reported as censored, never dropped.

    `proof` says what `converged` means: the novice alone passed a lap of the layout it was taught on ("own"), or so
    many fresh ones in a row ("fresh:3"); "none" if it was not tried. `contradictions` are labels that were set aside.
    """

    converged: bool
    laps: int
    human_labels: int
    demonstration: int
    interventions: int
    calls: int
    buffer: int
    training_steps: int
    simulated_s: float
    elapsed_s: float
    account: Account = Account()
    proof: str = "own"
    contradictions: tuple[ContradictionRecord, ...] = ()


class VerdictRecord(msgspec.Struct, frozen=True, tag="verdict"):
    """What a person's session came to: who taught, what was proven in words, and whether the novice passed."""

    person: str
    words: str
    passed: bool


class EditRecord(msgspec.Struct, frozen=True, tag="edit"):
    """How many labels were taken back, or learned again, after all that stands before it."""

    taken_back: int = 0
    learned_again: int = 0


Record = RunRecord | StepRecord | LapRecord | ResultRecord | VerdictRecord | EditRecord


class RunWriter:
    """Appends records to a file as JSON lines, one write each. The torn last line of a killed run is cut off first."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("ab", buffering=0)
            if path.is_file():
                self._file.truncate(_end_of_lines(path))
        except OSError as error:
            raise StorageError(
                f"cannot write the run record {path}: {error.strerror}", "Choose another folder."
            ) from error

    def write(self, record: Record) -> None:
        """Append one record. Raises `StorageError` when the disk does not take it."""
        line = memoryview(msgspec.json.encode(record) + b"\n")
        try:
            while line:  # after a short write the next one says why
                line = line[self._file.write(line) :]
        except OSError as error:
            raise StorageError(f"cannot write to {self.path}: {error.strerror}", "Free some space.") from error

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def read_run(path: Path) -> Iterator[Record]:
    """Yield the records of a file; a torn last line (a run that was killed) is left out.

    Raises `StorageError` for a file that is missing or not a run record.
    """
    decoder = msgspec.json.Decoder(Record)
    try:
        with open_regular(path) as file:
            for number, line in enumerate(iter(lambda: file.readline(LINE_BYTES), b""), start=1):
                if not line.endswith(b"\n") and len(line) < LINE_BYTES:
                    return
                try:
                    yield decoder.decode(line)
                except MALFORMED as error:
                    raise StorageError(
                        f"{path}, line {number}, is not a run record: {error}", "Is it the right file?"
                    ) from error
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}", "Check the path.") from error


def _end_of_lines(path: Path) -> int:
    """Where the last whole line of a file ends."""
    with path.open("rb") as file:
        end = file.seek(0, os.SEEK_END)
        start = max(0, end - LINE_BYTES)
        file.seek(start)
        tail = file.read()
    return start + tail.rfind(b"\n") + 1 if b"\n" in tail or start == 0 else end
