"""Effect sizes and intervals that describe samples; they never decide a claim."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LEVEL = 0.95
"""Of the intervals."""

BOOTSTRAP_SEED = 20250714
"""Fixed, so that the same trials always give the same interval."""
RESAMPLES = 1000


def _dominance(a: Floats, b: Floats) -> Floats:
    """Return P(A > B) - P(A < B) over all pairs; shapes [..., n] and [..., m] give [...]."""
    above = a[..., :, None] > b[..., None, :]
    below = a[..., :, None] < b[..., None, :]
    pairs = a.shape[-1] * b.shape[-1]
    counts: Floats = (above.sum(axis=(-1, -2)) - below.sum(axis=(-1, -2))) / np.float64(pairs)
    return counts


def cliffs_delta(a: Sequence[float], b: Sequence[float]) -> float:
    """Return Cliff's delta, P(A > B) - P(A < B), in [-1, 1]."""
    return float(_dominance(np.asarray(a, np.float64), np.asarray(b, np.float64)))


def a12(a: Sequence[float], b: Sequence[float]) -> float:
    """Return Vargha and Delaney's A12 = P(A > B) + P(A = B) / 2, in [0, 1]."""
    return (cliffs_delta(a, b) + 1) / 2


def iqm(values: Sequence[float]) -> float:
    """Return the mean of the middle half of values (interquartile mean), as rliable does; NaN for inf - inf."""
    return float(_iqm(np.asarray(values, np.float64)))


def _iqm(values: Floats) -> Floats:
    from scipy.stats import trim_mean  # its import takes longer than the collection of claims, which needs this module

    with np.errstate(invalid="ignore"):
        means: Floats = trim_mean(values, 0.25, axis=-1)
    return means


def median(values: Sequence[float]) -> float:
    """Return the median; infinities (failed trials) rank as such."""
    return float(statistics.median(values))


def _percentiles(resampled: Floats) -> tuple[float, float]:
    """Return the ends of the middle 95% of bootstrap statistics; no interpolation, since inf - inf is NaN."""
    low, high = np.quantile(resampled, [(1 - LEVEL) / 2, (1 + LEVEL) / 2], method="inverted_cdf")
    return float(low), float(high)


def _resampled(rng: np.random.Generator, values: Sequence[float]) -> Floats:
    """Return bootstrap samples of values, shape [RESAMPLES, n]."""
    sample = np.asarray(values, np.float64)
    return sample[rng.integers(0, len(sample), (RESAMPLES, len(sample)))]


def a12_interval(a: Sequence[float], b: Sequence[float]) -> tuple[float, float]:
    """Return the percentile bootstrap interval of A12 (fixed seed).

    Percentile rather than BCa: BCa fails on constant data, which solved tasks give.
    """
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    return _percentiles((_dominance(_resampled(rng, a), _resampled(rng, b)) + 1) / 2)


def iqm_interval(*strata: Sequence[float]) -> tuple[float, float]:
    """Return the stratified percentile bootstrap interval of the interquartile mean of all strata (fixed seed).

    Each stratum has the trials of a condition, and is resampled by itself (Agarwal et al. 2021).
    """
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    return _percentiles(_iqm(np.concatenate([_resampled(rng, stratum) for stratum in strata], axis=1)))


def median_interval(values: Sequence[float]) -> tuple[float, float]:
    """Return the percentile bootstrap interval of the median (fixed seed)."""
    drawn = np.sort(_resampled(np.random.default_rng(BOOTSTRAP_SEED), values), axis=1)
    low, high = drawn[:, (len(values) - 1) // 2], drawn[:, len(values) // 2]
    medians = np.array([x if x == y else (x + y) / 2 for x, y in zip(low, high, strict=True)], np.float64)
    return _percentiles(medians)
