"""No order of trials decides: pairings of the same numbers give one outcome, and the bound over all pairs is valid."""

from __future__ import annotations

import math
from itertools import permutations, product

import numpy as np
import pytest
from scipy.stats import binom

from evoclaims.judging.design import FIXED_10, SEQUENTIAL, Design
from evoclaims.judging.exact import pairs_test
from evoclaims.judging.judge import decide
from evoclaims.judging.kinds.greater import GreaterTests
from evoclaims.judging.verdict import Direction


@pytest.mark.parametrize("design", [FIXED_10, Design(SEQUENTIAL.looks[1:])])
def test_other_seeds_for_the_same_values_change_no_kind(source, design) -> None:
    rng = np.random.default_rng(0)
    for _ in range(10):
        a, b = rng.integers(0, 4, (2, 10)).astype(float).tolist()
        endings = set()
        for left, right in ((a, b), (a[::-1], rng.permutation(b).tolist())):
            one, other = source("a", left), source("b", right)
            for claim in (
                one.score() > other.score(),
                one.score().equivalent_to(other.score(), margin=2.0),
                one.score().between(1, 3),
                one.solved().stays() & (one.score() > other.score()),
            ):
                ending = decide(claim, design)
                endings.add((claim.describe(), ending.outcome, ending.finding.p))
        assert len(endings) == 4


def mean_share(wins: np.ndarray, n: int) -> float:
    """The share of wins as the mean over all pairings, by brute force."""
    return float(np.mean([wins[range(n), list(order)].mean() for order in permutations(range(wins.shape[1]), n)]))


def test_the_share_of_all_pairs_is_the_mean_over_all_pairings() -> None:
    rng = np.random.default_rng(1)
    for n, m in ((3, 3), (3, 5), (4, 4)):
        a, b = rng.integers(0, 4, n), rng.integers(0, 4, m)
        tests = GreaterTests(a.tolist(), b.tolist(), 0.71)
        assert tests.wins == pytest.approx(mean_share(a[:, None] >= b[None], n))


@pytest.mark.parametrize(("n", "alpha"), [(3, 0.05), (5, 0.01), (10, 0.04), (10, 0.05), (30, 0.0095)])
def test_the_bound_rejects_a_share_as_claimed_no_more_often_than_alpha(n: int, alpha: float) -> None:
    """Every outcome of trials with two values, of which most pairs are ties: exactly."""
    k = np.arange(n + 1)
    share = 1 - (1 - k / n)[:, None] * (k / n)[None]  # A at least B, unless A has 0 and B has 1
    rejected = np.array([[pairs_test(wins, n, 0.71) <= alpha for wins in row] for row in share])
    for p, q in product(np.linspace(0, 1, 21), repeat=2):
        if 1 - (1 - p) * q >= 0.71:
            assert binom.pmf(k, n, p) @ rejected @ binom.pmf(k, n, q) <= alpha


def test_the_bound_is_hoeffdings_and_its_ends_are_known() -> None:
    assert pairs_test(0.0, 10, 0.71) == pytest.approx(0.29**10)
    assert pairs_test(0.71, 10, 0.71) == pairs_test(1.0, 10, 0.71) == 1.0
    divergence = 0.23 * math.log(0.23 / 0.71) + 0.77 * math.log(0.77 / 0.29)
    assert pairs_test(0.23, 10, 0.71) == pytest.approx(math.exp(-10 * divergence))


@pytest.mark.parametrize(("known_a", "known_b", "n"), [(3, 4, 4), (4, 3, 4), (4, 4, 5)])
def test_what_is_decided_against_the_worst_results_is_so_for_all(source, known_a: int, known_b: int, n: int) -> None:
    """Missing trials with all results between, at and beyond the known values."""
    rng, decided = np.random.default_rng(7), 0
    for shift in (5, -5, 2, -2) * 3:
        a, b = rng.integers(shift, shift + 4, known_a).tolist(), rng.integers(0, 4, known_b).tolist()
        left, right = source("a", a), source("b", b)
        trials = {one.fingerprint: tuple(one.fetch(range(len(one.trials)))) for one in (left, right)}
        bound = (left.score() > right.score()).highest(trials, n, FIXED_10)
        lattice = np.arange(-6, 10, n - 3.5).tolist()
        every = [
            GreaterTests([*a, *new[: n - known_a]], [*b, *new[n - known_a :]], 0.71).p
            for new in product(lattice, repeat=2 * n - known_a - known_b)
        ]
        for alpha in (0.1, 0.2, 0.3):
            for direction in Direction:
                if bound.toward(direction) <= alpha:
                    assert all(p.toward(direction) <= alpha for p in every)
                    decided += 1
    assert decided > 10
