"""omnibus: some of several conditions differ, before pairs of them are compared."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, permutations
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.judging.assertion import Assertion, Entry, Finding
from evoclaims.judging.design import Design
from evoclaims.judging.effect import epsilon_squared
from evoclaims.judging.exact import ExactTest, rank_attainable
from evoclaims.judging.kinds.equivalent import Equivalent, equivalence_tests
from evoclaims.judging.reading import NumberReading, comparable, require_independent
from evoclaims.judging.sample import Trials
from evoclaims.judging.verdict import Bound, PValues

Sizes = tuple[int, ...]

MOST_SPLITS: Final = 50_000
"""Most splits of the pooled values into groups that are all tried."""

DRAWN: Final = 9_999
"""Splits that are drawn where there are more."""

SPLIT_SEED: Final = 20250714
"""Fixed, so that the same trials always have the same p."""


@dataclass(frozen=True)
class Omnibus(Assertion):
    """At least two of several conditions differ.

    Attributes:
        measures: of three or more conditions.
        margin: a difference that would not matter, in the measure's unit; without one, nothing can refute the claim.
    """

    measures: tuple[NumberReading, ...]
    margin: float | None = None
    kind: ClassVar[str] = "omnibus"
    entry: ClassVar[Entry] = Entry(
        syntax=("any_differ(a.reward, b.reward, c.reward)", "any_differ(a.reward, b.reward, c.reward, margin=5)"),
        null="All conditions have one distribution.",
        supported=(
            "A permutation test rejects that. Its p is the share of splits of the pooled trials with at least this H "
            f"(Kruskal and Wallis). Up to {MOST_SPLITS:,} splits are all counted. Of more, {DRAWN:,} are drawn once. "
            f"If b of these have at least this H, p is (b + 1) / ({DRAWN:,} + 1)."
        ),
        refuted="Without a margin never, since no trials show that nothing differs. With a margin: each pair is equal.",
        source="Kruskal and Wallis 1952; p of drawn splits: Phipson and Smyth 2010",
    )

    def __post_init__(self) -> None:
        """Reject fewer than three measures, and measures that cannot be ranked together or within the margin."""
        if len(self.measures) < 3:
            raise UserError("any_differ compares three or more measures; for two write a > b, or a.equivalent_to(b).")
        require_independent(*self.measures)
        if self.margin is not None:
            for left, right in combinations(self.measures, 2):
                Equivalent(left, right, self.margin)

    def describe(self) -> str:
        """Return "at least two of A, B and C differ"."""
        *first, last = (measure.describe() for measure in self.measures)
        margin = "" if self.margin is None else f" (it does not matter by less than {self.margin:g})"
        return f"at least two of {', '.join(first)} and {last} differ{margin}"

    def attainable(self, n: int, design: Design) -> PValues:
        """Return the p of complete separation; against, of pairs that are all equivalent."""
        sizes = (n,) * len(self.measures)
        separated = math.factorial(len(sizes)) / _count(sizes)
        smallest = separated if _count(sizes) <= MOST_SPLITS else max(separated, 1 / (DRAWN + 1))
        return PValues(min(1.0, smallest), 1.0 if self.margin is None else rank_attainable(n, n))

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        """Run the permutation test, and with a margin those of equivalence."""
        samples = tuple(measure.sample(trials) for measure in self.measures)
        groups = [sample.values for sample in samples]
        differ, alike = kruskal_wallis_test(groups), self._alike(groups)
        exact = _count(tuple(map(len, groups))) <= MOST_SPLITS
        small = max(differ.p, alike.p) <= alpha
        return self.found(
            PValues(differ.p, alike.p),
            PValues(differ.attainable_p, alike.attainable_p),
            alpha,
            samples,
            detail=(
                f"conditions explain {epsilon_squared(groups):.0%} of the ranks' variance; p over "
                + ("all splits" if exact else f"{DRAWN:,} drawn splits")
                + "; without a margin nothing can refute it" * (self.margin is None)
                + "; they differ, and by less than the margin" * small
            ),
            bounds=() if self.margin is None else (Bound("margin", float(self.margin), on_axis=False),),
        )

    def _alike(self, groups: Sequence[Sequence[float]]) -> ExactTest:
        """Return the test that every pair is equivalent: as weak as that of the weakest pair."""
        if self.margin is None:
            return ExactTest(1.0, 1.0)
        tests = [test for a, b in combinations(groups, 2) for test in equivalence_tests(a, b, self.margin)]
        return ExactTest(max(test.p for test in tests), max(test.attainable_p for test in tests))


def any_differ(*measures: NumberReading, margin: float | None = None) -> Omnibus:
    """Assert that at least two of several measures differ; see `Omnibus`.

    Args:
        measures: three or more, each of another condition.
        margin: with it the claim is refuted if each pair is equivalent within this difference, in the measure's unit;
            without it only support can be shown.

    Raises:
        UserError: for something that is not a measure, or measures in two units.
    """
    if not all(isinstance(measure, NumberReading) for measure in measures):
        raise UserError("any_differ compares measures of trials, such as any_differ(a.reward, b.reward, c.reward).")
    return Omnibus(comparable(*measures) if measures else (), margin)


def kruskal_wallis_test(groups: Sequence[Sequence[float]]) -> ExactTest:
    """Test whether groups differ: Kruskal and Wallis's H of the mid-ranks, by permutations.

    Under the null each split of the pooled values into groups of these sizes is equally likely. Up to `MOST_SPLITS` of
    them, p is the share of splits with an H as large. For more, b of `DRAWN` splits, drawn beforehand and independently
    of the trials, have an H as large, and p = (b + 1) / (DRAWN + 1): over draws of splits and trials it is at most
    alpha with a probability of at most alpha.

    Args:
        groups: one sequence of values for each condition; infinities rank as such.

    Raises:
        ValueError: for an empty group, or NaN, which cannot be ranked.
    """
    if not all(map(len, groups)) or any(math.isnan(value) for group in groups for value in group):
        raise ValueError("A Kruskal-Wallis test needs at least one value in each group, and none that is NaN.")
    from scipy.stats import rankdata  # as in `judging.exact`

    sizes = tuple(map(len, groups))
    ranks = 2 * rankdata([value for group in groups for value in group])  # whole numbers, mid-ranks too
    observed = _spread(ranks, _splits_as_given(sizes), sizes)[0]
    ordered = np.sort(ranks)
    # Groups that follow one another in the order of values are as far apart as these values allow.
    orders = {*permutations(sizes)} if len({*sizes}) > 1 else {sizes}  # of equal groups, all orders are one
    largest = max(_spread(ordered, _splits_as_given(order), order)[0] for order in orders)
    exact = _count(sizes) <= MOST_SPLITS
    spreads = _spread(ranks, _all_splits(sizes) if exact else _drawn_splits(sizes), sizes)

    def p(least: float) -> float:
        as_large = int((spreads >= least * (1 - 1e-12)).sum())  # sums of the same numbers in another order
        # All splits contain the observed one. Draws need not: counting it keeps p above 0 and the test valid.
        return as_large / len(spreads) if exact else (as_large + 1) / (len(spreads) + 1)

    return ExactTest(p(observed), p(largest))


def _spread(ranks: NDArray[np.float64], splits: NDArray[np.int8], sizes: Sizes) -> NDArray[np.float64]:
    """Return, for each split, the sum over groups of (sum of ranks)² / size, which rises with H.

    Args:
        ranks: of the pooled values, shape [N].
        splits: the group of each pooled value, shape [splits, N].
        sizes: of the groups.
    """
    spreads: NDArray[np.float64] = sum(
        (((splits == group) @ ranks) ** 2 / size for group, size in enumerate(sizes)), np.zeros(len(splits))
    )
    return spreads


def _count(sizes: Sizes) -> int:
    """Return the number of splits into groups of these sizes."""
    return math.factorial(sum(sizes)) // math.prod(map(math.factorial, sizes))


def _splits_as_given(sizes: Sizes) -> NDArray[np.int8]:
    """Return the one split in which the groups follow one another, shape [1, N]."""
    return np.repeat(np.arange(len(sizes), dtype=np.int8), sizes)[None]


@lru_cache(maxsize=8)
def _all_splits(sizes: Sizes) -> NDArray[np.int8]:
    """Return all splits, shape [splits, N]."""
    splits = np.full((1, sum(sizes)), len(sizes) - 1, np.int8)
    for group, size in enumerate(sizes[:-1]):
        free = np.argwhere(splits == len(sizes) - 1)[:, 1].reshape(len(splits), -1)
        chosen = np.array(list(combinations(range(free.shape[1]), size)))
        places = free[:, chosen].reshape(-1, size)
        splits = np.repeat(splits, len(chosen), axis=0)
        np.put_along_axis(splits, places, np.int8(group), axis=1)
    return splits


@lru_cache(maxsize=8)
def _drawn_splits(sizes: Sizes) -> NDArray[np.int8]:
    """Return splits drawn with a fixed seed, shape [DRAWN, N]."""
    rng = np.random.default_rng(SPLIT_SEED)
    return rng.permuted(np.repeat(_splits_as_given(sizes), DRAWN, axis=0), axis=1)
