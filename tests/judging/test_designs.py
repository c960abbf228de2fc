"""Designs: impossible ones are rejected; the margin is the effect that the paper's own detects with power 1/3."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import permutations

import numpy as np
import pytest
from scipy.stats import mannwhitneyu, norm

from evoclaims.core.errors import UserError
from evoclaims.judging.design import (
    FIXED_10,
    SEQUENTIAL,
    Design,
    Look,
    _u_distribution,
    comparison_power,
    detectable_a12,
)


def test_ten_against_ten_give_the_margin_of_all_committed_fingerprints() -> None:
    assert detectable_a12(10) == FIXED_10.a12_margin == 0.71
    assert SEQUENTIAL.for_paper(10) == SEQUENTIAL


@pytest.mark.parametrize("n", [5, 8, 10, 15])
def test_a_rank_test_of_normal_trials_detects_it_with_power_a_third(n: int) -> None:
    """Another family of alternatives, another implementation of the test, simulation instead of the closed form."""
    rng = np.random.default_rng(n)
    a, b = rng.normal(2**0.5 * norm.ppf(detectable_a12(n)), 1, (4000, n)), rng.normal(0, 1, (4000, n))
    power = (mannwhitneyu(a, b, axis=1, method="exact").pvalue <= 0.05).mean()
    assert power == pytest.approx(1 / 3, abs=0.05)


@pytest.mark.parametrize("odds", [1.0, 2.5])
def test_the_distribution_of_u_is_that_of_all_orders(odds: float) -> None:
    """Of three against three: an order's probability is the product of that of each largest value (Savage 1956)."""
    expected = np.zeros(10)
    for order in permutations(range(6)):  # from the largest down; 0 to 2 are of A
        chance, weights, wins, above = 1.0, [odds] * 3 + [1.0] * 3, 0, 0
        for at, one in enumerate(order):
            chance *= weights[one] / sum(weights[other] for other in order[at:])
            wins, above = (wins, above + 1) if one < 3 else (wins + above, above)
        expected[wins] += chance
    assert _u_distribution(3, odds) == pytest.approx(expected)


def test_larger_designs_detect_less_and_too_small_ones_nothing() -> None:
    margins = [detectable_a12(n) for n in (4, 5, 7, 10, 15, 20)]
    assert margins == sorted(margins, reverse=True)
    with pytest.raises(ValueError, match="never reaches"):
        detectable_a12(3)
    with pytest.raises(UserError, match="4 to 100 trials"):
        FIXED_10.for_paper(3)


def test_the_power_of_a_comparison_is_that_of_its_closed_form_and_of_normal_trials() -> None:
    odds = 0.8 / 0.2  # all three of A above all of B: each time the largest left is one of A
    assert comparison_power(3, 0.05, 0.8) == pytest.approx(math.prod(i * odds / (i * odds + 3) for i in (3, 2, 1)))
    assert 0.03 < comparison_power(10, 0.04, 0.5) <= 0.04
    rng = np.random.default_rng(0)
    a, b = rng.normal(2**0.5 * norm.ppf(0.8), 1, (4000, 10)), rng.normal(0, 1, (4000, 10))
    found = (mannwhitneyu(a, b, axis=1, method="exact", alternative="greater").pvalue <= 0.04).mean()
    assert comparison_power(10, 0.04, 0.8) == pytest.approx(found, abs=0.05)


def test_the_presets_are_the_specifications() -> None:
    assert FIXED_10.looks == (Look(10, 0.05),)
    assert SEQUENTIAL.looks == (Look(5, 0.01), Look(10, 0.04))
    assert SEQUENTIAL.alpha == pytest.approx(0.05)
    assert (FIXED_10.p0, FIXED_10.a12_margin, FIXED_10.seeds(3)) == (0.7, 0.71, (0, 1, 2))


def test_a_fixed_design_looks_once() -> None:
    assert Design.fixed(7).looks == (Look(7, 0.05),)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Look(0, 0.05), "1 to 100 trials"),
        (lambda: Look(101, 0.05), "1 to 100 trials"),
        (lambda: Look(10, 0.0), "alpha"),
        (lambda: Look(10, 1.0), "alpha"),
        (lambda: Design(()), "at least one look"),
        (lambda: Design((Look(5, 0.01), Look(5, 0.04))), "more than the one before"),
        (lambda: Design((Look(5, 0.5), Look(6, 0.5))), "add up to 1. Their sum must be below 1"),
        (lambda: Design((Look(5, 0.05),), p0=1.0), "p0"),
        (lambda: Design((Look(5, 0.05),), a12_margin=0.4), "A12 margin"),
        (lambda: Design((Look(5, 0.05),), first_seed=-1), "first seed is -1. It must be at least 0"),
    ],
)
def test_an_impossible_design_is_rejected_in_a_sentence(make: Callable[[], object], sentence: str) -> None:
    with pytest.raises(UserError, match=sentence):
        make()
