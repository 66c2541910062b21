"""Hands what a source has to those who look, at an even pace.

A viewer that falls behind loses samples: each bounds what it keeps, and nothing waits for it. The process itself gives
way to those that drive.
"""

import os
import threading
import time
from collections.abc import Collection, Sequence
from typing import Protocol

from lira.tools.view.source import Sample, Source

LOOK_HZ = 50.0
NICENESS = 10


class Viewer(Protocol):
    """Somebody who looks."""

    def wanted(self) -> Collection[str]:
        """Keys of the topics that are looked at now."""

    def show(self, samples: Sequence[Sample]) -> None:
        """Take what came; at once, whatever becomes of it."""

    def close(self) -> None:
        """Stop."""


def give_way() -> None:
    """Let this process wait for all others of the machine."""
    os.nice(NICENESS)


def stream(source: Source, viewers: Sequence[Viewer], stop: threading.Event) -> None:
    """Show the source to the viewers until it has ended or `stop` is set. What is late is not caught up with."""
    due_s = time.monotonic()
    while not stop.is_set() and not source.ended:
        wanted = [frozenset(viewer.wanted()) for viewer in viewers]
        source.listen(frozenset[str]().union(*wanted))
        samples = source.poll()
        for viewer, keys in zip(viewers, wanted, strict=True):
            viewer.show([sample for sample in samples if sample.topic.key in keys])
        due_s = max(due_s + 1.0 / LOOK_HZ, time.monotonic())
        stop.wait(due_s - time.monotonic())
