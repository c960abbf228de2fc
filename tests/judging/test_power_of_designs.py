"""Power: shares of draws agree with exact numbers, are the same each time, and say how many trials help."""

from __future__ import annotations

import math
from collections import Counter
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.judging.design import Design, Look
from evoclaims.judging.exact import binomial_test, clopper_pearson
from evoclaims.judging.judge import judge
from evoclaims.judging.measure import Event
from evoclaims.judging.power import Draws, event_power, power
from evoclaims.judging.sample import UnreadableTrialError
from evoclaims.judging.verdict import Outcome

TEN = Design.fixed(10)
SURELY = 1e-5
"""A right share is outside such an interval in one of 50,000 tests; the draws are fixed."""


def pilots(*sources):
    return {one.fingerprint: tuple(one.trials.values()) for one in sources}


def agrees(count: int, draws: int, exact: float) -> bool:
    low, high = clopper_pearson(count, draws, SURELY)
    return low <= exact <= high


@pytest.mark.parametrize("solved", [30, 48])
def test_the_power_of_a_binomial_test_is_that_of_the_binomial_distribution(source, solved) -> None:
    a = source("a", [1.0] * solved + [0.0] * (50 - solved))
    found = power(a.solved().in_most_trials(), TEN, Draws(pilots(a)))
    p = solved / 50
    assert agrees(found.counts[Outcome.SUPPORTED], 1000, p**10)  # ten of ten, and no fewer, support it
    refuting = sum(math.comb(10, k) * p**k * (1 - p) ** (10 - k) for k in range(5))
    assert agrees(found.counts[Outcome.REFUTED], 1000, refuting)
    assert found.power == found.share(Outcome.SUPPORTED)
    assert found.flips == found.share(Outcome.REFUTED)
    assert sum(found.counts.values()) == found.draws == 1000


def test_the_power_of_a_rank_test_is_that_of_all_possible_draws(source) -> None:
    a, b = source("a", [1.0, 2.0, 3.0, 9.0]), source("b", [0.0, 1.0, 2.5])
    design = Design.fixed(3)
    aboves, belows = (
        Counter(tuple(sorted(drawn)) for drawn in product(values, repeat=3))  # the order of trials decides nothing
        for values in ([1.0, 2.0, 3.0, 9.0], [0.0, 1.0, 2.5])
    )
    ways = Counter[Outcome]()
    for (above, m), (below, n) in product(aboves.items(), belows.items()):
        ways[judge(source("a", above).score() > source("b", below).score(), design).outcome] += m * n
    found = power(a.score() > b.score(), design, Draws(pilots(a, b)))
    assert 0.05 < ways[Outcome.SUPPORTED] / ways.total() < 0.5
    for outcome in Outcome:
        assert agrees(found.counts.get(outcome, 0), 1000, ways[outcome] / ways.total())


def test_trials_are_drawn_whole_so_that_measures_of_one_condition_agree(source) -> None:
    a = source("a", [1.0, 0.0] * 25)
    solved = a.solved()
    unsolved = Event(a, "unsolved", lambda trial: trial.metrics["score"] < 1.0)
    both = [*Draws(pilots(a)).outcomes(solved.in_most_trials(0.2) & unsolved.in_most_trials(0.2), TEN)]
    fours = sum(math.comb(10, k) for k in (5,)) / 2**10  # five of ten is all that supports both
    assert agrees(both.count(Outcome.SUPPORTED), 1000, fours)


def test_the_looks_of_the_design_are_followed(source) -> None:
    a = source("a", [1.0] * 50)
    found = power(a.solved().in_most_trials(), Design((Look(5, 0.2), Look(10, 0.04))), Draws(pilots(a), 50))
    assert (found.power, found.needed) == (1.0, 5)  # 0.7 ** 5 is below 0.24, the alpha of both looks


def test_a_design_with_too_few_trials_says_how_many_would_do(source) -> None:
    a = source("a", [1.0] * 50)
    found = power(a.solved().in_most_trials(), Design.fixed(5), Draws(pilots(a)))
    assert (found.power, found.share(Outcome.INCONCLUSIVE), found.suffices) == (0.0, 1.0, False)
    assert found.needed == 9  # 0.7 ** 9 is the first below 0.05
    assert power(a.solved().in_most_trials(), TEN, Draws(pilots(a))).needed == 9


def test_what_a_pilot_cannot_show_is_told_with_its_size(source) -> None:
    a = source("a", [1.0] * 28 + [0.0] * 12)  # just p0
    found = power(a.solved().in_most_trials(), TEN, Draws(pilots(a)))
    assert (found.needed, found.most, found.suffices) == (None, 40, False)


def test_about_so_many_trials_as_are_needed_suffice_and_one_fewer_do_not(source) -> None:
    a = source("a", [1.0] * 46 + [0.0] * 4)

    def exact(n: int) -> float:
        fewest = next(k for k in range(n + 1) if binomial_test(k, n, 0.7).p <= 0.05)
        return sum(math.comb(n, k) * 0.92**k * 0.08 ** (n - k) for k in range(fewest, n + 1))

    found = power(a.solved().in_most_trials(), TEN, Draws(pilots(a)))
    assert found.power < 0.5
    assert found.needed is not None
    assert exact(found.needed) > 0.93
    assert exact(found.needed - 1) < 0.97


def test_no_number_of_trials_makes_a_claim_undecided(source) -> None:
    a = source("a", [1.0, 0.0] * 25)
    found = power(a.solved().in_most_trials(0.5), TEN, Draws(pilots(a)), Outcome.INCONCLUSIVE)
    assert (found.needed, found.flips) == (None, 0.0)
    assert found.power == found.share(Outcome.INCONCLUSIVE) > 0.8


def test_draws_are_the_same_each_time_whatever_else_is_drawn(source) -> None:
    a, b = source("a", [float(i) for i in range(10)]), source("b", [i - 3.5 for i in range(10)])
    first = power(a.score() > b.score(), TEN, Draws(pilots(a, b), 200))
    others = Draws(pilots(b, a, source("c", [0.0] * 10)), 200)
    power(b.score().between(0, 1), TEN, others)
    assert power(a.score() > b.score(), TEN, others) == first
    assert 0.05 < first.power < 0.95


@pytest.mark.parametrize(
    ("values", "said"), [(["crashed"] * 10, "crashed"), ([(1.0, 2.0)] * 10, "There is no 'score'")]
)
def test_what_cannot_be_judged_is_an_error_and_no_share(source, values, said) -> None:
    a = source("a", values)
    with pytest.raises(UnreadableTrialError, match=said):
        power(a.solved().in_most_trials(), TEN, Draws(pilots(a)))


def _by_enumeration(looks: list[Look], p0: float, rate: float) -> float:
    """Return the power by going through every sequence of trials, one by one."""
    supported = 0.0
    for outcomes in product((True, False), repeat=looks[-1].n):
        for look in looks:
            held = sum(outcomes[: look.n])
            above, below = (binomial_test(held, look.n, p0, side).p <= look.alpha for side in ("greater", "less"))
            if above or below:
                supported += above * math.prod(rate if one else 1 - rate for one in outcomes)
                break
    return supported


@given(
    st.sets(st.integers(1, 9), min_size=1, max_size=3),
    st.lists(st.sampled_from([0.01, 0.05, 0.2, 0.3]), min_size=3, max_size=3),
    st.sampled_from([0.3, 0.5, 0.7]),
    st.sampled_from([0.05, 0.5, 0.8, 0.95]),
)
def test_the_power_of_an_event_over_looks_is_that_of_every_sequence(
    sizes: set[int], alphas: list[float], p0: float, rate: float
) -> None:
    looks = [Look(n, alpha) for n, alpha in zip(sorted(sizes), alphas, strict=False)]
    assert event_power(looks, p0, rate) == pytest.approx(_by_enumeration(looks, p0, rate))
