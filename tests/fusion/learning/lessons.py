"""Labels that take both sensors to learn."""

import numpy as np

from lira.fusion.learning.labels import Label
from lira.fusion.preprocess import Features

BINS = 101


def labels(count: int, seed: int = 0) -> list[Label]:
    """Steer to the brighter half, slow down for what is near."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        gray = rng.integers(0, 60, (32, 32))
        side = rng.choice([-1, 1])
        gray[:, 16:] += 150 * (side > 0)
        gray[:, :16] += 150 * (side < 0)
        near = rng.random()
        scan = np.clip(near + 0.05 * rng.random(BINS), 0, 1).astype(np.float32)
        image = (gray / 255).astype(np.float32)
        made.append(Label(Features(scan=scan, image=image), (2 * near - 1, 0.6 * float(side)), "human"))
    return made
