"""What `lira status` says: of each process, of each topic, of the link, and who drives. Pure, but for reading files."""

from typing import Any

import msgspec

from lira.tools.lifecycle import services
from lira.tools.lifecycle.folder import StateFolder
from lira.tools.lifecycle.records import HEARD, STATE, Heard, ProcessState, State
from lira.tools.lifecycle.restart import CALM_S, Phase
from lira.tools.lifecycle.setup import command_line
from lira.tools.output.table import format_table

OLD_S = 3.0  # what the monitor wrote longer ago says nothing of now


class Status(msgspec.Struct, frozen=True):
    """What is up under a name. `state` is None if nothing is, `heard` if nobody listens to its bus now."""

    name: str
    now_s: float
    state: State | None = None
    heard: Heard | None = None

    @property
    def is_well(self) -> bool:
        """Whether all of it runs, and the robot is heard where somebody listens."""
        return self.state is not None and self.state.runs and (self.heard is not None or not self.state.is_monitored)


def look(name: str, now_s: float) -> Status:
    """Read what is written down about a name. Raises `ConfigError` for what cannot be read."""
    folder = StateFolder(name)
    pid = folder.supervisor()
    state = services.look(name) if pid is None else folder.read(STATE, State)
    if state is None or state.pid != (pid or 0):
        return Status(name, now_s)
    heard = folder.read(HEARD, Heard)
    fresh = heard is not None and 0.0 <= now_s - heard.time_s <= OLD_S
    return Status(name, now_s, state, heard if fresh else None)


def as_object(status: Status) -> dict[str, Any]:
    """For a machine: times are ages in seconds."""
    state, heard, now_s = status.state, status.heard, status.now_s
    found: dict[str, Any] = {"name": status.name, "up": state is not None, "well": status.is_well}
    if state is not None:
        processes = []
        for process in state.processes:
            row = msgspec.to_builtins(process)
            row["for_s"] = round(now_s - row.pop("since_s"), 1)
            processes.append(row)
        found |= {"for_s": round(now_s - state.since_s, 1), "supervisor": state.pid}
        found |= {"setup": msgspec.to_builtins(state.setup), "processes": processes}
    if heard is not None:
        row = msgspec.to_builtins(heard)
        row["age_s"] = round(now_s - row.pop("time_s"), 3)
        found["heard"] = row
    return found


def as_text(status: Status) -> str:
    """For a person."""
    state, heard, now_s = status.state, status.heard, status.now_s
    if state is None:
        return f"nothing is up for '{status.name}'; start it with: {command_line('up', status.name)}"
    by = "" if state.pid else " (services of systemd)"
    head = f"'{status.name}' is up for {_for(now_s - state.since_s)}{by}: {state.setup.where}"
    blocks = [head, _processes(state, now_s)]
    if heard is None:
        if state.is_monitored:
            blocks.append(f"nothing is heard of the robot: see {command_line('logs monitor', status.name)}")
        return "\n\n".join(blocks)
    blocks.append(_topics(heard, now_s - heard.time_s))
    said = [("link", heard.link), ("governor", heard.governor), (heard.who, f"{heard.why} {heard.now}".strip())]
    blocks.append("\n".join(f"{what}: {words}" for what, words in said if words))
    return "\n\n".join(blocks)


def _processes(state: State, now_s: float) -> str:
    cells = []
    for process in state.processes:
        pid = "" if process.pid is None else str(process.pid)
        cells.append([process.name, process.phase, pid, _for(now_s - process.since_s), str(process.starts)])
    names = ("process", "phase", "pid", "for", "starts")
    lines = format_table(names, cells).splitlines()
    notes = ["says", *(_note(process, now_s) for process in state.processes)]
    width = max(map(len, lines))
    return "\n".join(f"{line.ljust(width)}  {note}".rstrip() for line, note in zip(lines, notes, strict=True))


def _note(process: ProcessState, now_s: float) -> str:
    """What it says, and how it ended last, until it has run for so long that this is over."""
    words, over = process.says or process.does, process.phase is Phase.RUNS and now_s - process.since_s >= CALM_S
    return words if over or not process.ended else f"{words} (it ended with {process.ended})"


def _topics(heard: Heard, late_s: float) -> str:
    cells = []
    for topic in heard.topics:
        if topic.age_s is not None:
            cells.append([topic.key, f"{topic.rate_hz:.1f}", f"{topic.expected_hz:g}", f"{topic.age_s + late_s:.1f}"])
    return format_table(("topic", "Hz", "usual", "age/s"), cells)


def _for(seconds: float) -> str:
    """How long, in the unit that fits."""
    for limit, divisor, unit in ((120.0, 1.0, "s"), (7200.0, 60.0, "min"), (float("inf"), 3600.0, "h")):
        if seconds < limit:
            return f"{seconds / divisor:.0f} {unit}"
    raise AssertionError
