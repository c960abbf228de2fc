"""One test of whether anything changed in several conditions, by permutations of whole trials, and where it shows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evoclaims.judging.drift_report import FOUND, DriftRow
from evoclaims.judging.exact import holm

PERMUTATIONS: Final = 19_999
"""Fewest of a joint test, whose p is at least about 3 / 20,000; of many methods there are more."""

SEED: Final = 20251126
"""Fixed, so that the same trials always give the same p."""


@dataclass(frozen=True, eq=False)
class Columns:
    """What is tested of a condition: measures that the same trials have.

    Attributes:
        rows: of its measures that are not constant, each with its own exact two-sided p; at least one.
        centred: mid-ranks minus their mean, by trial, new ones first, and measure; shape [n_new + n_ref, measures].
        n: number of new trials.
        wide: whether the pilot's trials are among the earlier ones.
    """

    rows: tuple[DriftRow, ...]
    centred: NDArray[np.float64]
    n: int
    wide: bool

    @property
    def spread(self) -> NDArray[np.float64]:
        """The standard deviation of the sum of the new trials' ranks, shape [measures]."""
        total = len(self.centred)
        variance = (self.centred**2).sum(axis=0) * self.n * (total - self.n) / (total * (total - 1))
        return np.asarray(np.sqrt(np.where(variance > 0, variance, 1.0)))


def permutations_for(families: int, alpha: float) -> int:
    """Return a number of permutations with which p can be half of what Holm's correction and two blocks ask for."""
    return max(PERMUTATIONS, math.ceil(2 * 3 * 2 * families / alpha))


def p_by_blocks(conditions: Sequence[Columns], count: int) -> float:
    """Return the p that nothing changed: the smaller of two, doubled, where some measures alone are in pilots."""
    blocks = [those for wide in (True, False) if (those := [one for one in conditions if one.wide is wide])]
    return min(1.0, len(blocks) * min(joint_p(those, count) for those in blocks))


def joint_p(conditions: Sequence[Columns], count: int) -> float:
    """Return the p of the hypothesis that nothing changed in some conditions.

    A single measure of a single condition has its exact p. Else new and earlier trials are exchanged at random, whole
    trials within each condition, `count` times with a fixed seed. Three statistics of the measures' rank sums z
    look for three kinds of change: the sum over conditions (all better, or all worse), the sum of squares (anything),
    and the largest (one alone). Their smallest p is itself compared with its distribution over the permutations, so
    that p is valid for any dependence of measures.
    """
    if len(conditions) == 1 and len(conditions[0].rows) == 1:
        return conditions[0].rows[0].p or 1.0
    rng = np.random.default_rng(SEED)
    sums = np.zeros(count + 1)
    squares, largest = np.zeros_like(sums), np.zeros_like(sums)
    for one in conditions:
        chosen = np.argpartition(rng.random((count, len(one.centred))), one.n, axis=1)[:, : one.n]
        observed = one.centred[: one.n].sum(axis=0)[None]
        z = np.concatenate([observed, one.centred[chosen].sum(axis=1)]) / one.spread
        together = z.sum(axis=1)
        sums += together / max(float(together.std()), 1e-12)
        squares += (z**2).mean(axis=1)
        largest = np.maximum(largest, np.abs(z).max(axis=1))
    statistics = np.round([np.abs(sums), squares, largest], 9)  # equal ones, whatever the order of their sums
    smallest = np.min([_share_above(statistic) for statistic in statistics], axis=0)
    return float(np.mean(smallest <= smallest[0]))


def _share_above(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return for each value the share of values that are at least as large."""
    order = np.sort(values)
    return np.asarray(1 - np.searchsorted(order, values, side="left") / len(values))


def places_of(conditions: Sequence[Columns], count: int, alpha: float) -> set[tuple[str, str]]:
    """Return where a method's drift shows, by label and measure: what Holm's correction finds, at least one."""
    joint = [joint_p([one], count) for one in conditions]
    found = [one for one, p in zip(conditions, holm(joint), strict=True) if p <= alpha]
    found = found or [conditions[int(np.argmin(joint))]]
    rows = [row for one in found for row in one.rows]
    ps = holm([row.p or 1.0 for row in rows])
    sure = {(row.label, row.metric) for row, p in zip(rows, ps, strict=True) if p <= alpha}
    return sure | {min((row.p or 1.0, row.label, row.metric) for row in one.rows)[1:] for one in found}


def detectable_shift(conditions: Sequence[Columns], alpha: float) -> float:
    """Return the shift of all measures, in standard deviations, that is found with probability `FOUND`.

    The normal approximation of the sum over conditions, at a third of alpha for each of three statistics; of normal
    values, a rank sum loses 1 - 3/π of the information.
    """
    from scipy.stats import norm  # as in `judging.exact`

    sides = {one.wide for one in conditions}
    conditions = [one for one in conditions if one.wide is max(sides)]
    z = float(norm.isf(alpha / (2 * 3 * len(sides))) + norm.ppf(FOUND))
    means = [math.sqrt(3 / math.pi * one.n * (len(one.centred) - one.n) / (len(one.centred) + 1)) for one in conditions]
    return z * math.sqrt(len(conditions)) / math.fsum(means)
