"""No kind errs more often than alpha: 10,000 draws under the null, ties included, or every outcome."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations, combinations_with_replacement, product

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from evoclaims.judging.assertion import AllOf, AnyOf, Compound
from evoclaims.judging.exact import binomial_test, rank_test
from evoclaims.judging.kinds.threshold import sign_tests
from evoclaims.judging.kinds.trend import kendall_s
from evoclaims.judging.verdict import PValues

DRAWS = 10_000
Draw = Callable[[np.random.Generator, tuple[int, ...]], NDArray[np.float64]]

NULLS: dict[str, Draw] = {
    "continuous": lambda rng, shape: rng.normal(size=shape),
    "three values": lambda rng, shape: rng.integers(0, 3, shape).astype(np.float64),
    "mostly solved": lambda rng, shape: np.where(rng.random(shape) < 0.8, 1.0, rng.random(shape).round(1)),
    "failures": lambda rng, shape: np.where(rng.random(shape) < 0.2, -np.inf, rng.integers(0, 9, shape)),
}


def assert_rate_at_most(alpha: float, errors: int) -> None:
    """Fail when the errors among the draws could hardly come from a rate of alpha (itself an exact test)."""
    assert binomial_test(errors, DRAWS, alpha).p > 1e-3, f"{errors / DRAWS:.4f} > {alpha}"


@pytest.mark.parametrize("null", NULLS)
def test_two_looks_together_err_no_more_often_than_their_alphas(null: str) -> None:
    data = NULLS[null](np.random.default_rng(0), (DRAWS, 2, 10)).tolist()
    errors = sum(rank_test(a[:5], b[:5]).p <= 0.01 or rank_test(a, b).p <= 0.04 for a, b in data)
    assert_rate_at_most(0.05, errors)


@pytest.mark.parametrize("null", ["three values", "half rise and half fall"])
@pytest.mark.parametrize("n", [5, 10])
def test_a_trend_is_supported_no_more_often_than_alpha(n: int, null: str) -> None:
    rng = np.random.default_rng(n)
    if null == "half rise and half fall":
        data = np.arange(9.0) * rng.choice([-1.0, 1.0], (DRAWS, n, 1))
    else:
        data = NULLS[null](rng, (DRAWS, n, 4))
    slopes = [[kendall_s(row) for row in rows] for rows in data.tolist()]
    p = [sign_tests(sum(s < 0 for s in rows), sum(s > 0 for s in rows), n) for rows in slopes]
    assert_rate_at_most(0.05, sum(one.supported <= 0.05 for one in p))
    assert_rate_at_most(0.05, sum(one.refuted <= 0.05 for one in p))


@pytest.mark.parametrize("compound", [AllOf, AnyOf])
@pytest.mark.parametrize("p0", [0.5, 0.7])
def test_three_parts_together_err_no_more_often_than_alpha_either_way(compound: type[Compound], p0: float) -> None:
    """Every outcome of three events whose probability is p0, the edge of both hypotheses."""
    n = 10
    parts = [
        (mass, PValues(binomial_test(k, n, p0, "greater").p, binomial_test(k, n, p0, "less").p))
        for k, mass in enumerate(binom.pmf(range(n + 1), n, p0).tolist())
    ]
    together = [
        (math.prod(mass for mass, _ in three), compound(()).combine([p for _, p in three]))
        for three in product(parts, repeat=3)
    ]
    for alpha in (0.05, 0.04, 0.01):
        assert sum(mass for mass, p in together if p.supported <= alpha) <= alpha
        assert sum(mass for mass, p in together if p.refuted <= alpha) <= alpha


def test_the_rank_test_is_exactly_valid_for_every_tie_pattern_of_four_against_four() -> None:
    for pooled in combinations_with_replacement(range(4), 8):
        ps = []
        for chosen in combinations(range(8), 4):
            rest = [pooled[i] for i in range(8) if i not in chosen]
            ps.append(rank_test([pooled[i] for i in chosen], rest).p)
        assert all(sum(other <= p for other in ps) / len(ps) <= p + 1e-12 for p in set(ps))
