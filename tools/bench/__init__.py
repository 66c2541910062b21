"""Benchmarks. Each module has `run() -> rows`: medians of several runs, ratios against a reference in the same run."""

import os
import platform
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

Row = dict[str, object]

# Those in `learning/`.
LEARNING = {
    "preprocess": "a JPEG of 640x480 to 32x32 gray, beside full decoding and resizing",
    "decide": "a decision of three networks, beside the same networks in PyTorch",
    "step": "where the time of one decision step goes, and of a whole run on line-obstacles",
    "train": "one training step, beside plain PyTorch (and Keras, if installed), and what it does to the control loop",
    "log": "a million labels: the log written, opened and learned from, and the memory that takes",
    "trial": "trials of the usual methods, medians over --seeds: seconds, those of the processor, and their shares",
}
BENCHES = {
    "twin": "the twin in process: times real time as a sketch and in pybullet, which is put beside its bare calls",
    "lockstep": "twin and learner in two processes over the bus in lockstep: times real time",
    "latency": "from a capture to the applied command through the whole stack, beside a bare zenoh echo",
    "takeover": "from pressing the dead-man to the applied command, while a policy drives",
    "web": "the page: what a browser fetches, how soon it sees a picture, what three of them cost",
    "drivers": "what the drivers need of a core, how old a published scan is, what the lidar's line loses in --minutes",
    "record": "control beside a recorder and without, for --minutes each; the recorder's share of a core, and losses",
    "fuzz": "garbage to every decoder that faces the bus",
    "soak": "twin, learner, joystick bridge and console for --minutes: memory, threads and files stay flat",
    **LEARNING,
}
PACKAGES = ("numpy", "opencv-python-headless", "rosbags", "eclipse-zenoh", "pybullet", "torch")


def module_of(name: str) -> str:
    """Return the full name of a benchmark's module."""
    return f"{__name__}.learning.{name}" if name in LEARNING else f"{__name__}.{name}"


def describe_machine() -> Row:
    """Say what the numbers were measured on."""
    packages = {}
    for package in PACKAGES:
        try:
            packages[package] = version(package)
        except PackageNotFoundError:
            continue
    return {
        "cpu": cpu_model(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "packages": packages,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def cpu_model(cpuinfo: Path = Path("/proc/cpuinfo")) -> str:
    """Name of the processor, as far as the system tells."""
    if sys.platform == "linux" and cpuinfo.exists():
        for line in cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def columns(rows: Sequence[Row]) -> list[str]:
    """Every field of any row, in order of first appearance."""
    return list(dict.fromkeys(name for row in rows for name in row))


def cell(value: object) -> str:
    """A field as text: three significant digits for a float."""
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"
    return "" if value is None else str(value)


def cpu_s(pid: int) -> float:
    """Seconds of a core that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")
