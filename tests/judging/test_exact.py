"""The exact tests and Holm's correction against enumeration, scipy and sums over all cases."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import combinations
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import mannwhitneyu, rankdata

from evoclaims.judging.exact import (
    binomial_test,
    clopper_pearson,
    holm,
    rank_attainable,
    rank_test,
    smallest,
    two_sided_rank_p,
)

few_values = st.lists(st.sampled_from([-math.inf, 0.0, 1.0, 2.5, math.inf]), min_size=1, max_size=5)


def enumerated(a: list[float], b: list[float]) -> tuple[float, float]:
    """Return p and the smallest p by going through every split of the pooled mid-ranks."""
    ranks = [round(2 * rank) for rank in rankdata([*a, *b])]
    sums = [sum(split) for split in combinations(ranks, len(a))]
    observed = sum(ranks[: len(a)])
    return (
        float(Fraction(sum(s >= observed for s in sums), len(sums))),
        float(Fraction(sum(s == max(sums) for s in sums), len(sums))),
    )


@given(few_values, few_values)
def test_the_rank_test_equals_enumeration_of_all_splits(a: list[float], b: list[float]) -> None:
    test = rank_test(a, b)
    assert (test.p, test.attainable_p) == enumerated(a, b)
    assert two_sided_rank_p(a, b) == min(1.0, 2 * test.p, 2 * rank_test(b, a).p)
    assert rank_attainable(len(a), len(b)) == rank_test(range(9, 9 + len(a)), range(len(b))).p


def test_a_hundred_against_a_hundred_agrees_with_the_exact_distribution_of_scipy() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(0.3, 1, 100), rng.normal(0, 1, 100)
    scipys = mannwhitneyu(a, b, alternative="greater", method="exact").pvalue
    assert rank_test(a, b).p == pytest.approx(scipys, rel=1e-9)


@pytest.mark.parametrize(
    ("a", "b", "said"),
    [([math.nan], [1.0], "NaN"), ([1.0], [0.0, math.nan], "NaN"), ([], [1.0], "at least one value")],
)
def test_what_cannot_be_ranked_is_rejected(a: list[float], b: list[float], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        rank_test(a, b)


@given(st.integers(1, 20).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))), st.floats(0.05, 0.95))
def test_the_binomial_test_sums_the_tail(k_n: tuple[int, int], p0: float) -> None:
    k, n = k_n
    mass = [comb(n, j) * p0**j * (1 - p0) ** (n - j) for j in range(n + 1)]
    above, below = binomial_test(k, n, p0, "greater"), binomial_test(k, n, p0, "less")
    assert (above.p, above.attainable_p) == pytest.approx((sum(mass[k:]), mass[n]), rel=1e-9)
    assert (below.p, below.attainable_p) == pytest.approx((sum(mass[: k + 1]), mass[0]), rel=1e-9)


def test_ten_of_ten_proves_only_0_741() -> None:
    low, high = clopper_pearson(10, 10)
    assert low == pytest.approx(0.741, abs=5e-4)
    assert high == 1.0


@pytest.mark.parametrize(
    ("p0", "alternative", "said"),
    [(0.0, "greater", "strictly between"), (1.0, "less", "strictly between"), (0.5, "two-sided", "greater, less")],
)
def test_a_null_without_uncertainty_and_an_unknown_alternative_are_rejected(p0: float, alternative, said: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ValueError, match=said):
        binomial_test(1, 2, p0, alternative)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=6))
@settings(max_examples=30)
def test_holm_steps_down_from_the_smallest_p(ps: list[float]) -> None:
    order = sorted(range(len(ps)), key=ps.__getitem__)
    expected, running = [0.0] * len(ps), 0.0
    for step, index in enumerate(order):
        running = max(running, min(1.0, (len(ps) - step) * ps[index]))
        expected[index] = running
    assert holm(ps) == pytest.approx(tuple(expected))
    assert smallest(ps) == min(holm(ps))
    assert holm([]) == ()
