"""Live progress of a run, read from its record while it grows."""

import shutil
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TextIO

import msgspec

from lira.fusion.log.run_log import EditRecord, LapRecord, Record, ResultRecord, RunRecord, StepRecord, VerdictRecord
from lira.hal.config import MALFORMED
from lira.hal.errors import StorageError
from lira.hal.messages import Call, Decision, MethodCalls, Phase
from lira.hal.words import plural
from lira.tools.output.label_words import so_far_words
from lira.tools.output.lap_names import lap_name
from lira.tools.output.proven import edit_words, proof_words

Publish = Callable[[Decision | MethodCalls], None]
Say = Callable[[str], None]

TTY_PERIOD_S = 0.1
PLAIN_PERIOD_S = 5.0


class Tail:
    """Reads what is appended to a run record, whole lines only. The file may not be there yet."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._decoder = msgspec.json.Decoder(Record)
        self._offset = 0

    def read(self) -> list[Record]:
        """Return the records since the last call. Raises `StorageError` for a line that is none."""
        try:
            with self._path.open("rb") as file:
                file.seek(self._offset)
                data = file.read()
        except FileNotFoundError:
            return []
        whole = data[: data.rfind(b"\n") + 1]
        self._offset += len(whole)
        try:
            return [self._decoder.decode(line) for line in whole.splitlines()]
        except MALFORMED as error:
            raise StorageError(f"{self._path} is not a run record: {error}", "Is it the right file?") from error


class Progress:
    """Turns records into words. Feed it with `note`; pure but for what it remembers."""

    def __init__(self) -> None:
        self._first: StepRecord | None = None
        self._newest: StepRecord | None = None
        self._proofs: Counter[int] = Counter()  # proving runs after each training lap
        self.result: ResultRecord | None = None

    def note(self, record: Record) -> str | None:
        """Take one record in; return the line worth keeping, if it makes one."""
        match record:
            case StepRecord():
                self._first = self._first or record
                self._newest = record
                return None
            case RunRecord():
                self._proofs.clear()
                return (
                    f"{record.method} ({record.preset}) on {record.world}, layout {record.layout}, seed {record.seed}"
                )
            case LapRecord():
                line = lap_line(record, self._turn(record.lap))
                self._proofs[record.lap] += record.phase == Phase.PROVE
                return line
            case ResultRecord():
                self.result = record
                return result_line(record)
            case VerdictRecord():
                return f"verdict: {record.words}"
            case EditRecord():
                return edit_words(record)

    def status(self) -> str:
        """Where the run is now, in one line; empty before the first step."""
        if self._newest is None or self._first is None:
            return ""
        decision = self._newest.decision
        name = lap_name(decision.phase, decision.lap, self._newest.layout, self._turn(decision.lap))
        words = [name, f"{decision.driver} drives"]
        if decision.call != Call.NONE:
            words.append(f"{decision.call} call")
        words.append(so_far_words(decision.labels))
        words.append(f"{plural(decision.interventions, 'intervention')}, {plural(decision.calls, 'call')}")
        elapsed_s = self._newest.elapsed_s - self._first.elapsed_s
        if elapsed_s > 1.0:
            words.append(f"{(decision.stamp_s - self._first.decision.stamp_s) / elapsed_s:.0f}x real time")
        return " | ".join(words)

    def _turn(self, lap: int) -> int:
        return self._proofs[lap] + 1


def lap_line(lap: LapRecord, turn: int = 1) -> str:
    """One finished lap; `turn` counts the proving runs after a training lap."""
    name = lap_name(lap.phase, lap.lap, lap.layout, turn)
    words = f"{name:<16} {'passed' if lap.passed else 'failed'} {lap.duration_s:6.1f} s"
    words += f"  collisions {lap.collisions}, lost {lap.lost}"
    if lap.stops:
        words += f", stops to ask {lap.stops}"
    if lap.shielded:
        words += f", turns changed by the shield {lap.shielded}"
    if lap.phase == Phase.TRAIN:
        words += f"  human labels {lap.human_labels}, interventions {lap.interventions}, calls {lap.calls},"
        words += f" labels learned {lap.buffer}, training steps {lap.training_steps}"
    return words


def result_line(result: ResultRecord) -> str:
    """Say how the whole run ended."""
    speed = f", {result.simulated_s / result.elapsed_s:.0f}x real time" if result.elapsed_s > 0 else ""
    return f"{proof_words(result)}; {result.elapsed_s:.0f} s{speed}"


class Display:
    """Shows lines that stay and one that changes: rewritten in place on a terminal, else printed now and then."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._tty = stream.isatty()
        self._period_s = TTY_PERIOD_S if self._tty else PLAIN_PERIOD_S
        self._next_s = time.monotonic() + self._period_s
        self._shown = ""

    def keep(self, line: str) -> None:
        """Print a line that stays."""
        self._erase()
        print(line, file=self._stream, flush=True)

    def status(self, line: str) -> None:
        """Show where things are, if the last time was long enough ago."""
        if not line or line == self._shown or time.monotonic() < self._next_s:
            return
        self._next_s = time.monotonic() + self._period_s
        if self._tty:
            self._erase()
            width = shutil.get_terminal_size().columns - 1
            self._stream.write(line[:width])
            self._stream.flush()
        else:
            print(line, file=self._stream, flush=True)
        self._shown = line

    def close(self) -> None:
        """Leave the terminal with an empty line."""
        self._erase()

    def _erase(self) -> None:
        if self._tty and self._shown:
            self._stream.write("\r\x1b[K")
            self._stream.flush()
            self._shown = ""


def telling(say: Say, write: Callable[[Record], None] | None = None) -> Callable[[Record], None]:
    """Return what says how each lap went, and writes every record if there is where to."""
    progress = Progress()

    def take(record: Record) -> None:
        if write is not None:
            write(record)
        line = progress.note(record)
        if line is not None:
            say(line)

    return take
