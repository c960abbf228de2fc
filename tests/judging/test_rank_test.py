"""The exact rank test against enumeration, scipy and the numbers of the specification."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import PermutationMethod, mannwhitneyu, rankdata

from evoclaims.judging.exact import rank_attainable, rank_test, two_sided_rank_p

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
@settings(deadline=None)
def test_the_rank_test_equals_enumeration_of_all_splits(a: list[float], b: list[float]) -> None:
    test = rank_test(a, b)
    assert (test.p, test.attainable_p) == enumerated(a, b)


@given(few_values, few_values)
@settings(deadline=None)
def test_the_two_sided_p_is_twice_the_smaller_one(a: list[float], b: list[float]) -> None:
    assert two_sided_rank_p(a, b) == min(1.0, 2 * rank_test(a, b).p, 2 * rank_test(b, a).p)


def test_ties_do_not_fool_the_rank_test_as_they_fool_scipys_default() -> None:
    assert rank_test([1, 1, 1], [0, 0, 0]).p == 0.05
    assert mannwhitneyu([1, 1, 1], [0, 0, 0], alternative="greater").pvalue == pytest.approx(0.023, abs=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_the_rank_test_equals_scipys_full_permutation_test(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.integers(0, 4, 5), rng.integers(0, 4, 6)
    method = PermutationMethod(n_resamples=math.comb(11, 5) + 1)
    scipys = mannwhitneyu(a, b, alternative="greater", method=method).pvalue
    assert rank_test(a, b).p == pytest.approx(scipys, abs=1e-12)


@pytest.mark.parametrize(("n", "m", "p"), [(3, 3, 0.05), (5, 5, 0.0040), (10, 10, 5.4e-6), (3, 10, 0.0035)])
def test_the_smallest_attainable_p_is_the_specifications(n: int, m: int, p: float) -> None:
    separated = rank_test(range(100, 100 + n), range(m))
    assert separated.p == separated.attainable_p == rank_attainable(n, m)
    assert rank_attainable(n, m) == pytest.approx(p, rel=0.02)


def test_a_hundred_against_a_hundred_agrees_with_the_exact_distribution_of_scipy() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(0.3, 1, 100), rng.normal(0, 1, 100)
    scipys = mannwhitneyu(a, b, alternative="greater", method="exact").pvalue
    assert rank_test(a, b).p == pytest.approx(scipys, rel=1e-9)


def test_when_all_values_tie_nothing_is_attainable() -> None:
    test = rank_test([1.0] * 10, [1.0] * 10)
    assert test.p == test.attainable_p == 1.0


@pytest.mark.parametrize(("a", "b"), [([math.nan], [1.0]), ([1.0], [0.0, math.nan])])
def test_nan_has_no_rank(a: list[float], b: list[float]) -> None:
    with pytest.raises(ValueError, match="NaN"):
        rank_test(a, b)


def test_an_empty_side_is_rejected() -> None:
    with pytest.raises(ValueError, match="at least one value"):
        rank_test([], [1.0])
