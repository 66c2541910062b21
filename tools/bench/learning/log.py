"""A million labels: the demonstration log written, opened again and learned from, and the memory that takes.

Labels go into a temporary folder, 1.6 GB of them, and 1.4 GB into the learner's own file beside it.
"""

import os
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from lira.fusion.inference.threads import one_thread
from lira.fusion.learning.labels import Label
from lira.fusion.learning.learner import Learner
from lira.fusion.log.label_log import Demonstration, DemonstrationLog, read_demonstrations
from lira.fusion.policies.networks import FusionNet
from lira.fusion.preprocess import Features, shapes_of
from lira.hal.messages import Driver
from lira.hal.profile import load_profile
from lira.tools.bench import Row

LABELS = 1_000_000
PROFILE = "thesis-sim"
KINDS = 64  # different labels, over and over


def run() -> list[Row]:
    """Return one row per thing done with the log; `rss_mb` is the resident size after it, `grown_mb` what it added."""
    one_thread()
    profile = load_profile(PROFILE)
    learner = Learner(FusionNet(shapes_of(profile), profile.features.filters), seed=0, frozen_trunks=True)
    learner.add(next(random_labels(1)))
    learner.train_step()  # loads what is slow the first time
    rows: list[Row] = []
    before_mb = resident_mb()

    def note(what: str, began_s: float, labels: int = LABELS) -> None:
        took_s, rss_mb = time.perf_counter() - began_s, resident_mb()
        row: Row = {"what": what, "labels": labels, "s": took_s, "us_per_label": 1e6 * took_s / labels}
        rows.append({**row, "rss_mb": rss_mb, "grown_mb": rss_mb - before_mb})

    with TemporaryDirectory() as folder:
        path = Path(folder) / "labels.lira"
        with DemonstrationLog(path, profile) as log:
            began = time.perf_counter()
            for k, label in enumerate(random_labels(LABELS)):
                log.append(as_demonstration(k, label))
            note("append", began)
        began = time.perf_counter()
        with DemonstrationLog(path, profile):
            note("open again", began)
        began = time.perf_counter()
        for record in read_demonstrations(path):
            learner.add(Label(record.features, record.action, record.source))
        note("read and learn", began)
        began = time.perf_counter()
        learner.train_step()
        note("one training step", began)
        rows[0]["file_mb"] = path.stat().st_size / 1e6
    return rows


def random_labels(count: int) -> Iterator[Label]:
    """Noise: neither the time nor the memory depends on what is seen."""
    shapes, rng = shapes_of(load_profile(PROFILE)), np.random.default_rng(0)

    def noise() -> Features:
        grays = {name: (rng.integers(0, 256, shape) / 255).astype(np.float32) for name, shape in shapes.items()}
        return Features(**grays)

    kinds = [Label(noise(), (1.0, float(rng.uniform(-1, 1))), Driver.HUMAN) for _ in range(KINDS)]
    for k in range(count):
        yield kinds[k % KINDS]


def as_demonstration(k: int, label: Label) -> Demonstration:
    """Give a label its place in a session."""
    return Demonstration(0.2 * k, k, 1 + k // 400, label.source, label.action, (0.0, 0.0), True, label.features)


def resident_mb() -> float:
    """Resident size of this process in MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
