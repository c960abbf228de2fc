"""How often a comparison ends how, by its true A12: false support and both kinds of refutation, at every look."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.stats import binom, multivariate_normal, norm

from evoclaims.judging.design import COMPUTED, FIXED_10, SEQUENTIAL, THREE_LOOKS, Design, Look
from evoclaims.judging.exact import binomial_test
from evoclaims.judging.kinds.greater import GreaterTests
from evoclaims.judging.verdict import Outcome

SUPPORTED, REFUTED, SMALLER = Outcome.SUPPORTED, Outcome.REFUTED, Outcome.SMALLER
THREE = SEQUENTIAL.with_third_look()
DESIGNS = {"ten": FIXED_10, "five and ten": SEQUENTIAL, "five, ten and thirty": THREE}
Rates = dict[Outcome, float]


def ended(looks: list[Outcome]) -> Outcome:
    """What the judge makes of looks, none of which is curtailed: test_judge.py has its rules."""
    first = next((one for one in looks if one is not Outcome.INCONCLUSIVE), Outcome.INCONCLUSIVE)
    return REFUTED if first is SMALLER and REFUTED in looks else first


@cache
def of_distinct_values(n: int, alpha: float) -> list[Outcome]:
    """The outcome by the number of winning pairs, without ties."""
    found = []
    for wins in range(n * n + 1):
        full, part = divmod(wins, n)
        a = [n + i + 0.5 for i in range(full)] + [part - 0.5] * (full < n) + [-i - 1.5 for i in range(n - full - 1)]
        found.append(GreaterTests(a, [float(i) for i in range(n)], 0.71).p.outcome(alpha))
    return found


def of_normal_trials(design: Design, a12: float, draws: int = 4000) -> Rates:
    """Rates by simulation."""
    rng = np.random.default_rng(round(100 * a12))
    n = design.last.n
    a, b = rng.normal(2**0.5 * norm.ppf(a12), 1, (draws, n)), rng.normal(0, 1, (draws, n))
    wins = [(a[:, : k.n, None] > b[:, None, : k.n]).sum((1, 2)) for k in design.looks]
    tables = [of_distinct_values(k.n, k.alpha) for k in design.looks]
    outcomes = [ended([table[w] for table, w in zip(tables, row, strict=True)]) for row in np.transpose(wins)]
    return {one: outcomes.count(one) / draws for one in Outcome}


@cache
def of_two_values(n: int, alpha: float) -> list[list[Outcome]]:
    """The outcome by how many trials of A and of B have the larger of two values."""
    sides = [[1.0] * k + [0.0] * (n - k) for k in range(n + 1)]
    return [[GreaterTests(a, b, 0.71).p.outcome(alpha) for b in sides] for a in sides]


def of_successes(design: Design, p: float, q: float) -> Rates:
    """Rates for trials with two values, exactly: by the path of successes through the looks."""
    alive = {(0, 0, ()): 1.0}
    before = 0
    for look in design.looks:
        more = look.n - before
        chance = [binom.pmf(np.arange(more + 1), more, rate).tolist() for rate in (p, q)]
        grown: dict[tuple[int, int, tuple[Outcome, ...]], float] = {}
        table = of_two_values(look.n, look.alpha)
        for (i, j, past), mass in alive.items():
            for x, of_a in enumerate(chance[0]):
                for y, of_b in enumerate(chance[1]):
                    now = table[i + x][j + y]
                    key = i + x, j + y, (*past, now) if now is not Outcome.INCONCLUSIVE else past
                    grown[key] = grown.get(key, 0.0) + mass * of_a * of_b
        alive, before = grown, look.n
    rates = dict.fromkeys(Outcome, 0.0)
    for (_, _, past), mass in alive.items():
        rates[ended(list(past))] += mass
    return rates


@pytest.mark.parametrize("name", DESIGNS)
def test_rates_of_comparisons_without_ties(name: str) -> None:
    """The binomial tolerance is for 4,000 draws; at 0.71 both kinds of refutation are false, at 0.5 support is."""
    design, tolerance = DESIGNS[name], 3.3 * (0.05 * 0.95 / 4000) ** 0.5
    rates = {a12: of_normal_trials(design, a12) for a12 in (0.5, 0.55, 0.6, 0.71)}
    assert rates[0.5][SUPPORTED] <= design.alpha + tolerance
    assert rates[0.71][REFUTED] + rates[0.71][SMALLER] <= design.alpha + tolerance
    # The opposite of what is true is shown no more often than alpha, and ever less often.
    opposite = [rates[a12][REFUTED] for a12 in rates]
    assert opposite[0] <= design.alpha + tolerance
    assert opposite == sorted(opposite, reverse=True)
    # Two words: most of what used to be called refuted at a true A12 of 0.6 is only smaller than claimed.
    assert rates[0.6][REFUTED] <= 0.01


@pytest.mark.parametrize("name", DESIGNS)
@pytest.mark.parametrize("a12", [0.5, 0.55, 0.6, 0.71])
def test_rates_of_comparisons_with_two_values(name: str, a12: float) -> None:
    """Exactly, for several shares of ties."""
    design = DESIGNS[name]
    for middle in (0.2, 0.5, 0.7):
        p, q = middle + (a12 - 0.5), middle - (a12 - 0.5)
        if not 0 <= q <= p <= 1:
            continue
        rates = of_successes(design, p, q)
        assert sum(rates.values()) == pytest.approx(1.0)
        if a12 == 0.5:
            assert rates[SUPPORTED] <= design.alpha
        assert rates[REFUTED] <= design.alpha
        if 1 - (1 - p) * q >= 0.71:
            assert rates[REFUTED] + rates[SMALLER] <= design.alpha


@pytest.mark.parametrize("looks", [SEQUENTIAL.looks, THREE_LOOKS])
def test_events_err_in_all_looks_together_no_more_often_than_the_whole_alpha(looks: tuple[Look, ...]) -> None:
    """Exactly, for every kind that counts trials (solves, stays, threshold, band, trend), at 33 probabilities."""
    for p0 in np.linspace(0.02, 0.98, 33).tolist():
        for alternative in ("greater", "less"):
            alive, before, errors = np.ones(1), 0, 0.0
            for look in looks:
                alive = np.convolve(alive, binom.pmf(np.arange(look.n - before + 1), look.n - before, p0))
                reject = [binomial_test(k, look.n, p0, alternative).p <= look.alpha for k in range(look.n + 1)]  # type: ignore[arg-type]
                errors += alive[reject].sum()
                alive, before = np.where(reject, 0.0, alive), look.n
            assert errors <= 0.05, (p0, alternative)


def test_three_looks_err_no_more_often_than_0_05_where_each_test_spends_its_alpha() -> None:
    n, alphas = [[getattr(look, name) for look in THREE_LOOKS] for name in ("n", "alpha")]
    correlations = [[(min(i, j) / max(i, j)) ** 0.5 for i in n] for j in n]
    rate = 1 - multivariate_normal.cdf(norm.isf(alphas), np.zeros(3), correlations, abseps=1e-7, releps=1e-7)
    assert 0.049 < rate <= COMPUTED[THREE_LOOKS] == THREE.alpha == 0.05


def test_a_third_look_changes_no_verdict_of_the_first_two() -> None:
    assert THREE.looks[:2] == SEQUENTIAL.looks
    assert THREE.with_third_look() == THREE
    assert FIXED_10.with_third_look() == FIXED_10  # its α is spent at ten trials
