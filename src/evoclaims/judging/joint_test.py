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

FIRST: Final = 1_999
"""Permutations that suffice where p turns out to be above `CLEAR`."""

CLEAR: Final = 0.1
"""A p of `FIRST` permutations above it stands. It stays valid: both p, and that below α, are at most α as often."""

CHUNK: Final = 5_000
"""Permutations in memory at once."""

IN_PILOTS: Final = 0.8
"""Share of α for measures that pilots have, where others are tested, too: against ten trials little can be found."""

SEED: Final = 20251126
"""Fixed, so that the same trials always give the same p."""


@dataclass(frozen=True, eq=False)
class Columns:
    """What is tested of a condition: measures that the same trials have.

    Attributes:
        rows: of its measures that are not constant, each with its own exact two-sided p; at least one.
        centred: mid-ranks minus their mean, by trial, new ones first, and measure; shape [n_new + n_ref, measures].
        n: number of new trials.
        trials: side and seed of each trial, in the same order: trials of one seed may depend on each other.
        wide: whether the pilot's trials are among the earlier ones.
    """

    rows: tuple[DriftRow, ...]
    centred: NDArray[np.float64]
    n: int
    trials: tuple[tuple[str, int], ...]
    wide: bool

    @property
    def spread(self) -> NDArray[np.float64]:
        """The standard deviation of the sum of the new trials' ranks, shape [measures]."""
        total = len(self.centred)
        variance = (self.centred**2).sum(axis=0) * self.n * (total - self.n) / (total * (total - 1))
        return np.asarray(np.sqrt(np.where(variance > 0, variance, 1.0)))

    @property
    def seen(self) -> float:
        """The mean of a standardized rank sum if normal values have moved by one standard deviation.

        Of these, ranks lose 1 - 3/π of the information.
        """
        total = len(self.centred)
        return math.sqrt(3 / math.pi * self.n * (total - self.n) / (total + 1))


def permutations_for(families: int, alpha: float) -> int:
    """Return a number of permutations with which p can be half of what Holm's correction and two blocks ask for."""
    return max(PERMUTATIONS, math.ceil(2 * 3 * families / (alpha * (1 - IN_PILOTS))))


def p_by_blocks(conditions: Sequence[Columns], count: int) -> float:
    """Return the p that nothing changed: the smaller of two by their shares, where only some measures are in pilots."""
    blocks = {wide: those for wide in (True, False) if (those := [one for one in conditions if one.wide is wide])}
    return min(1.0, min(joint_p(those, count) / _share_of(wide, len(blocks)) for wide, those in blocks.items()))


def _share_of(wide: bool, blocks: int) -> float:
    return 1.0 if blocks == 1 else IN_PILOTS if wide else 1 - IN_PILOTS


def joint_p(conditions: Sequence[Columns], count: int) -> float:
    """Return the p of the hypothesis that nothing changed in some conditions.

    A single measure of a single condition has its exact p. Else new and earlier trials are exchanged at random, whole
    trials within each condition, `count` times with a fixed seed. Trials of one seed are exchanged together in all
    conditions, as they may share random numbers. Three statistics of the measures' rank sums z
    look for three kinds of change: the sum over conditions (all better, or all worse), the sum of squares (anything),
    and the largest (one alone). In the sum, a condition counts by the shift that its numbers of trials can show. Their
    smallest p is itself compared with its distribution over the permutations, so that p is valid for any dependence
    of measures, and of conditions that have the same seeds.
    """
    if len(conditions) == 1 and len(conditions[0].rows) == 1:
        return conditions[0].rows[0].p or 1.0
    p = _permuted(conditions, FIRST)
    return p if p > CLEAR else _permuted(conditions, count)


def _permuted(conditions: Sequence[Columns], count: int) -> float:
    rng = np.random.default_rng(SEED)
    sums = np.zeros(count + 1)
    squares, largest = np.zeros_like(sums), np.zeros_like(sums)
    place = {trial: at for at, trial in enumerate(sorted({trial for one in conditions for trial in one.trials}))}
    drawn = [[one.centred[: one.n].sum(axis=0)[None]] for one in conditions]
    for begin in range(0, count, CHUNK):
        keys = rng.random((min(CHUNK, count - begin), len(place)))
        for one, those in zip(conditions, drawn, strict=True):
            mine = keys[:, [place[trial] for trial in one.trials]]
            those.append(one.centred[np.argpartition(mine, one.n, axis=1)[:, : one.n]].sum(axis=1))
    for one, those in zip(conditions, drawn, strict=True):
        z = np.concatenate(those) / one.spread
        together = z.sum(axis=1)
        sums += one.seen * together / max(float(together.std()), 1e-12)
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

    The normal approximation of the sum over conditions, at a third of its α for each of three statistics.
    """
    from scipy.stats import norm  # as in `judging.exact`

    sides = {one.wide for one in conditions}
    share = _share_of(max(sides), len(sides))
    z = float(norm.isf(alpha * share / (2 * 3)) + norm.ppf(FOUND))
    tested = [one for one in conditions if one.wide is max(sides)]
    return z * _spread_of_sum(tested) / sum(one.seen**2 for one in tested)


def _spread_of_sum(conditions: Sequence[Columns]) -> float:
    """Return the standard deviation of the sum over conditions, which is larger where their trials vary together."""
    total: dict[tuple[str, int], float] = {}
    for one in conditions:
        scores = (one.centred / one.spread).sum(axis=1)
        scores *= one.seen / max(float(np.linalg.norm(scores)), 1e-12)
        for trial, score in zip(one.trials, scores.tolist(), strict=True):
            total[trial] = total.get(trial, 0.0) + score
    return math.hypot(*total.values())
