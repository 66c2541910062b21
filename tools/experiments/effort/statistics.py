"""Statistics for few, skewed, paired samples: medians, interquartile means, bootstrap intervals."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

RESAMPLES = 10_000

Floats = NDArray[np.float64]


def iqm(values: Sequence[float]) -> float:
    """Interquartile mean: the mean of the middle half, less noisy than the median and robust unlike the mean."""
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    cut = int(0.25 * ordered.size)
    return float(ordered[cut : ordered.size - cut].mean())


def bootstrap(values: Sequence[float], statistic: Callable[[Floats], Floats], seed: int = 0) -> tuple[float, float]:
    """95 % percentile interval of `statistic`, which maps resamples [RESAMPLES, n] to [RESAMPLES]."""
    sample = np.asarray(values, dtype=np.float64)
    picks = np.random.default_rng(seed).integers(sample.size, size=(RESAMPLES, sample.size))
    low, high = np.quantile(statistic(sample[picks]), (0.025, 0.975), method="nearest")
    return float(low), float(high)


def median_interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Median with its 95 % interval: (median, low, high)."""
    low, high = bootstrap(values, lambda resamples: np.median(resamples, axis=1))
    return float(np.median(values)), low, high


def paired_ratios(numerators: Sequence[float], denominators: Sequence[float]) -> list[float]:
    """Ratio of each pair. A denominator of nothing counts as one half: a ratio has to stay finite."""
    return [a / max(b, 0.5) for a, b in zip(numerators, denominators, strict=True)]
