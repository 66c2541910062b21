"""Statistics of a data set's features, as LeRobot normalises by them. Pure."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
SAMPLED, MOST_PIXELS = 100, 30_000  # pictures of an episode at most, evenly, and numbers of each
Statistics = dict[str, list[Any]]


def statistics_of(values: NDArray[Any]) -> Statistics:
    """Return them for a feature, [n] or [n, parts], by part; nan counts for nothing. Lists, as JSON has them."""
    rows = np.asarray(values, np.float64).reshape(len(values), -1)
    parts = [column[np.isfinite(column)] for column in rows.T]
    parts = [part if part.size else np.zeros(1) for part in parts]
    return {
        "min": [float(part.min()) for part in parts],
        "max": [float(part.max()) for part in parts],
        "mean": [float(part.mean()) for part in parts],
        "std": [float(part.std()) for part in parts],
        "count": [len(rows)],
        **{name: [float(np.quantile(part, share)) for part in parts] for name, share in QUANTILES.items()},
    }


class PictureSampler:
    """Looks at some pictures of each episode as they pass. `lengths` are those of the episodes."""

    def __init__(self, lengths: Sequence[int]) -> None:
        self._lengths = lengths
        self._seen: list[list[NDArray[np.uint8]]] = []

    def through(self, pictures: Iterable[NDArray[np.uint8]]) -> Iterator[NDArray[np.uint8]]:
        """Let all pictures of all episodes pass, RGB uint8 [height, width, 3]."""
        passing = iter(pictures)
        for length in self._lengths:
            wanted = set(np.linspace(0, length - 1, min(length, SAMPLED)).round().astype(int).tolist())
            self._seen.append([])
            for number, picture in enumerate(islice(passing, length)):
                if number in wanted:
                    self._seen[-1].append(picture.reshape(-1, 3)[:: max(1, picture.size // MOST_PIXELS)].copy())
                yield picture

    def statistics(self) -> list[Statistics]:
        """Return those of each episode that has passed, by colour, in [0, 1], [3][1][1]."""
        return [_by_colour(seen) for seen in self._seen]


def _by_colour(seen: Sequence[NDArray[np.uint8]]) -> Statistics:
    found = statistics_of(np.concatenate(seen) / 255.0)
    shaped = {name: [[[value]] for value in values] for name, values in found.items() if name != "count"}
    return {**shaped, "count": [len(seen)]}


def merged(parts: Sequence[Statistics]) -> Statistics:
    """Return those of several episodes together. Quantiles are their mean, weighted by length, as LeRobot has it."""
    counts = np.array([part["count"][0] for part in parts], np.float64)
    whole = {name: np.array([part[name] for part in parts], np.float64) for name in parts[0]}
    weights = (counts / counts.sum()).reshape(-1, *[1] * (whole["mean"].ndim - 1))
    mean = (weights * whole["mean"]).sum(0)
    spread = (weights * (whole["std"] ** 2 + (whole["mean"] - mean) ** 2)).sum(0)
    return {
        "min": whole["min"].min(0).tolist(),
        "max": whole["max"].max(0).tolist(),
        "mean": mean.tolist(),
        "std": np.sqrt(spread).tolist(),
        "count": [int(counts.sum())],
        **{name: (weights * whole[name]).sum(0).tolist() for name in QUANTILES},
    }
