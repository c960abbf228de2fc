"""How often equivalence ends how, by the true A12 of the first side, at every look, with ties."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import norm
from test_outcome_rates import DESIGNS, REFUTED, SMALLER, SUPPORTED, ended

from evoclaims.judging.design import Design
from evoclaims.judging.exact import rank_test
from evoclaims.judging.kinds.equivalent import Equivalent, equivalence_tests
from evoclaims.judging.sample import UnreadableTrialError
from evoclaims.judging.verdict import Outcome, PValues

DRAWS = {False: 400, True: 100}
"""Without ties, and with them, where each test counts anew."""
TOLERANCE = {tied: 3.3 * (0.05 * 0.95 / draws) ** 0.5 for tied, draws in DRAWS.items()}
"""Of a rate of 0.05 among so many draws: a binomial's 3.3 standard deviations."""
MOST = max(design.last.n for design in DESIGNS.values())
A12 = (0.5, 0.55, 0.6, 0.71)
MARGIN = float(2**0.5 * norm.ppf(0.71))
"""The shift of normal trials at which A12 is 0.71: there, the two sides are no longer equivalent."""
Array = NDArray[np.float64]


@cache
def drawn(a12: float, tied: bool) -> Array:
    """Normal trials of two conditions, the first shifted, [2, draws, MOST]; ties on steps of twice the margin."""
    trials = np.random.default_rng(round(100 * a12)).normal(size=(2, DRAWS[tied], MOST))
    if tied:
        trials = 2 * MARGIN * np.round(trials / (2 * MARGIN))
    trials[0] += 2**0.5 * norm.ppf(a12)
    return trials


@cache
def p_by_wins(n: int, wins: int) -> float:
    """The rank test's p without ties, by the number of pairs that A wins."""
    full, part = divmod(wins, n)
    a = [n + i + 0.5 for i in range(full)] + [part - 0.5] * (full < n) + [-i - 1.5 for i in range(n - full - 1)]
    return rank_test(a, [float(i) for i in range(n)]).p


def p_above(a: Array, b: Array, tied: bool) -> Array:
    """The rank test's p that A is above B for each draw, shapes [draws, n]."""
    if tied:  # what is equal but for rounding ties
        return np.array([rank_test(*pair).p for pair in np.stack([a, b], axis=1).round(6).tolist()])
    return np.array([p_by_wins(a.shape[1], wins) for wins in (a[:, :, None] > b[:, None]).sum((1, 2)).tolist()])


@cache
def p_inside(a12: float, n: int, tied: bool) -> Array:
    """Equivalence of the two conditions within the margin."""
    a, b = drawn(a12, tied)[:, :, :n]
    return np.maximum(p_above(a + MARGIN, b, tied), p_above(b, a - MARGIN, tied))


@cache
def p_outside(a12: float, n: int, tied: bool) -> Array:
    """One of the two conditions beyond the other by more than the margin."""
    a, b = drawn(a12, tied)[:, :, :n]
    return np.minimum(1, 2 * np.minimum(p_above(b, a + MARGIN, tied), p_above(a - MARGIN, b, tied)))


def rates(design: Design, p: list[tuple[Array, Array]]) -> dict[Outcome, float]:
    """How draws end whose p at each look, for and against, are given."""
    looks = [
        [PValues(*pair).outcome(look.alpha) for pair in zip(*(side.tolist() for side in both), strict=True)]
        for look, both in zip(design.looks, p, strict=True)
    ]
    outcomes = [ended(list(row)) for row in zip(*looks, strict=True)]
    return {one: outcomes.count(one) / len(outcomes) for one in Outcome}


@pytest.mark.parametrize("tied", [False, True])
@pytest.mark.parametrize("name", DESIGNS)
def test_rates_of_equivalence_by_the_true_a12(name: str, tied: bool) -> None:
    """Support is false at the margin, refutation up to it; no size is claimed, so that none is smaller."""
    design = DESIGNS[name]
    found = {
        a12: rates(design, [(p_inside(a12, n, tied), p_outside(a12, n, tied)) for n in sizes(design)]) for a12 in A12
    }
    assert found[0.71][SUPPORTED] <= design.alpha + TOLERANCE[tied]
    assert all(found[a12][REFUTED] <= design.alpha + TOLERANCE[tied] for a12 in A12)
    assert all(found[a12][SMALLER] == 0 for a12 in A12)
    assert found[0.5][SUPPORTED] > found[0.71][SUPPORTED]  # it can be shown where it is true


def sizes(design: Design) -> list[int]:
    return [look.n for look in design.looks]


@pytest.mark.parametrize("tied", [False, True])
def test_the_p_of_many_draws_are_those_of_the_judge(source, tied: bool) -> None:
    trials = drawn(0.6, tied)[:, :, :10]
    for at in range(5):
        a, b = trials[:, at].tolist()
        one, other = source("a", a), source("b", b)
        claim = Equivalent(one.score(), other.score(), MARGIN)
        p = claim.find({of.fingerprint: of.fetch(range(10)) for of in (one, other)}, DESIGNS["ten"], 0.05).p
        assert p.supported == max(test.p for test in equivalence_tests(a, b, MARGIN))
        assert p_inside(0.6, 10, tied)[at] == pytest.approx(p.supported)
        assert p_outside(0.6, 10, tied)[at] == pytest.approx(p.refuted)


def test_a_margin_below_what_tells_numbers_apart_is_refused(source: Any) -> None:
    """Values 0.015 apart counted as equal, and so as within 0.001."""
    one, other = (
        source(name, [20_000.5 + apart + k / 10**7 for k in range(10)]) for name, apart in (("a", 0.0), ("b", 0.015))
    )
    with pytest.raises(UnreadableTrialError, match=r"numbers as large as 20000\.5 count as equal up to 0\.04"):
        _found(Equivalent(one.score(), other.score(), 0.001), one, other)
    assert _found(Equivalent(one.score(), other.score(), 0.05), one, other).p.supported < 0.05


def _found(claim: Equivalent, *sides: Any) -> Any:
    return claim.find({side.fingerprint: side.fetch(range(10)) for side in sides}, DESIGNS["ten"], 0.05)
