"""Ratios, and measures that are observed up to a limit or in steps: what is compared is what both sides show."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.core.errors import UserError
from evoclaims.judging.design import FIXED_10, Design
from evoclaims.judging.exact import rank_test
from evoclaims.judging.judge import judge
from evoclaims.judging.kinds.greater import GreaterTests
from evoclaims.judging.measure import Measure
from evoclaims.judging.verdict import Outcome
from evoclaims.judging.window import EVERYTHING, Window, shared

SUPPORTED, REFUTED, INCONCLUSIVE = Outcome.SUPPORTED, Outcome.REFUTED, Outcome.INCONCLUSIVE
times = st.integers(1, 400).map(float)
limits = st.integers(8, 50).map(lambda k: 10.0 * k)


def until(source, label, values, window) -> Measure:  # type: ignore[no-untyped-def]
    return source(label, values).score("lower").seen_through(window)


@given(times, limits, limits, st.sampled_from([0.0, 5.0, 10.0]), st.sampled_from([20.0, 40.0]))
def test_what_one_side_cannot_tell_apart_the_other_does_not_either(
    time: float, limit: float, other: float, fine: float, coarse: float
) -> None:
    one, two = Window(limit, fine), Window(other, coarse)
    both = shared([one, two])
    assert shared([two, one]) == both
    assert both.seen(one.seen(time)) == both.seen(two.seen(time)) == both.seen(time)


@given(st.lists(times, min_size=1, max_size=6), st.lists(times, min_size=1, max_size=6), limits, limits)
def test_two_limits_make_gehans_order(a: list[float], b: list[float], of_a: float, of_b: float) -> None:
    both = shared([Window(of_a), Window(of_b)])
    for x in a:
        for y in b:
            known = (x <= of_a and (y <= of_b or x <= of_b)) or (y <= of_b and y <= of_a)
            expected = (x > y) - (x < y) if known else 0
            seen = both.seen(x), both.seen(y)
            assert (seen[0] > seen[1]) - (seen[0] < seen[1]) == expected


@pytest.mark.parametrize("times", [range(1, 9), [1, 1, 2, 3, 5, 5, 7, 9], [9] * 8])
@pytest.mark.parametrize("limits", [(9, 9), (6, 4), (2, 8), (1, 9)])
def test_among_all_splits_none_is_judged_sooner_too_often(times, limits) -> None:
    of_a, of_b = map(Window, map(float, limits))
    both = shared([of_a, of_b])
    ps = []
    for chosen in combinations(range(8), 4):
        a = [both.seen(of_a.seen(float(times[i]))) for i in chosen]
        b = [both.seen(of_b.seen(float(times[i]))) for i in range(8) if i not in chosen]
        ps.append(rank_test(b, a).p)
    assert all(sum(other <= p for other in ps) / len(ps) <= p + 1e-12 for p in set(ps))


@pytest.mark.parametrize(
    ("a", "b", "outcome"),
    [
        ([10.0] * 10, [70.0] * 10, SUPPORTED),
        ([10.0] * 10, [99.0] * 10, SUPPORTED),  # b never: the worst rank
        ([99.0] * 10, [10.0] * 10, REFUTED),
        ([99.0] * 10, [99.0] * 10, INCONCLUSIVE),  # nobody knows which would have been sooner
        ([60.0] * 10, [99.0] * 10, INCONCLUSIVE),  # at 60 a has come after b was given up, at 50
        ([10.0] * 10, ["diverged"] * 10, SUPPORTED),
    ],
)
def test_never_is_the_worst_rank_and_nothing_is_known_beyond_the_shorter_budget(source, a, b, outcome) -> None:
    sooner = until(source, "a", a, Window(80.0)) < until(source, "b", b, Window(50.0 if b == [99.0] * 10 else 80.0))
    verdict = judge(sooner, FIXED_10)
    assert verdict.outcome is outcome
    assert verdict.evidence[0].samples[0].limit == (50.0 if b == [99.0] * 10 else 80.0)


def test_steps_of_several_sizes_are_compared_by_the_largest(source) -> None:
    a, b = until(source, "a", [11.0] * 10, Window(100.0)), until(source, "b", [20.0] * 10, Window(100.0, 20.0))
    assert judge(a < b, FIXED_10).outcome is INCONCLUSIVE  # both are known to be at most 20
    assert judge(a < until(source, "c", [40.0] * 10, Window(100.0, 20.0)), FIXED_10).outcome is SUPPORTED
    assert (a < b).describe() == "b: score, within 100 > a: score, within 100"


def test_nothing_is_asserted_beyond_what_is_observed(source) -> None:
    a = until(source, "a", [10.0] * 6 + [99.0] * 4, Window(80.0))
    assert judge(a < 80, FIXED_10).evidence[0].detail.startswith("6 of 10 below 80, 4 above")
    assert judge(a.between(5, 80), FIXED_10).evidence[0].detail == "0 below, 6 inside, 4 above"
    for assertion in (lambda: a < 81, lambda: a > 81, lambda: a.between(5, 81)):
        with pytest.raises(UserError, match="within 80' is not observed beyond that.*about 81"):
            assertion()
    with pytest.raises(UserError, match="the distance of two trials beyond it is unknown"):
        a.equivalent_to(until(source, "b", [], Window(80.0)), margin=5)
    assert judge(a.never_above_itself(), FIXED_10).outcome is SUPPORTED


def test_a_number_between_two_reports_is_refused_since_trials_on_both_sides_of_it_look_alike(source) -> None:
    a = until(source, "a", [22.0] * 10, Window(70.0, 20.0))  # of an exact 22 a report at 40 tells
    for assertion in (lambda: a > 30, lambda: a < 30, lambda: a.between(30, 60), lambda: a.between(20, 30)):
        with pytest.raises(UserError, match="known to multiples of 20, .* nothing about 30. Name 20 or 40, or let"):
            assertion()
    assert judge(a < 60, FIXED_10).outcome is judge(a > 20, FIXED_10).outcome is SUPPORTED
    assert judge(a.between(0, 70), FIXED_10).outcome is SUPPORTED  # the budget's end is seen


def test_the_interval_of_a_median_says_where_observation_ends(source) -> None:
    a = until(source, "a", [10.0] * 5 + [99.0] * 5, Window(80.0))
    (interval,) = judge(a < 50, FIXED_10).evidence[0].intervals
    assert interval.of == "median, 95% percentile bootstrap, nothing beyond 80"
    assert (interval.low, interval.high) == (10.0, 80.0)


@given(st.lists(st.tuples(times, times, times), min_size=2, max_size=8), st.integers(1, 7))
def test_times_between_reports_never_show_more_than_the_times_themselves(spans, first) -> None:
    known = [sorted(span) for span in spans]
    a, b = known[: min(first, len(known) - 1)], known[min(first, len(known) - 1) :]
    (least_a, true_a, most_a), (least_b, true_b, most_b) = zip(*a, strict=True), zip(*b, strict=True)
    between, true = GreaterTests(most_a, most_b, 0.71, (least_a, least_b)), GreaterTests(true_a, true_b, 0.71)
    assert between.p.supported >= true.p.supported
    assert between.p.refuted >= true.p.refuted
    assert between.p.smaller >= true.p.smaller


@pytest.mark.parametrize("better", ["higher", "lower"])
@pytest.mark.parametrize(
    ("factor", "outcome"), [(0.5, SUPPORTED), (1.9, SUPPORTED), (2.0, INCONCLUSIVE), (2.1, REFUTED), (100, REFUTED)]
)
def test_twice_as_much_is_a_rank_test_of_scaled_values(source, better, factor, outcome) -> None:
    a, b = source("a", [20.0] * 10).score(better), source("b", [10.0] * 10).score(better)
    assert judge(factor * b < a, FIXED_10).outcome is outcome
    assert judge(b * factor < a, FIXED_10).p == judge(factor * b < a, FIXED_10).p


def test_a_ratio_has_the_p_of_the_values_multiplied(source) -> None:
    for a, b in np.random.default_rng(0).integers(0, 7, (50, 2, 4)).astype(float).tolist():
        found = judge(2 * source("a", a).score() < source("b", b).score(), Design.fixed(4))
        assert found.p == rank_test(b, [2 * value for value in a]).p


def test_a_limit_is_scaled_with_its_values(source) -> None:
    a = until(source, "a", [], Window(80.0, 4.0))
    assert (2 * a).window == Window(160.0, 8.0)
    assert (2 * a).describe() == "a: 2 × score, within 160"
    assert (0.1 * a).window.seen(0.1 * 12.0) == pytest.approx(1.2)
    b = until(source, "b", [], Window(100.0, 4.0))
    assert {m.window for m in (2 * a < b).readings()} == {Window(96.0, 8.0)}


def test_a_failed_trial_stays_the_worst_when_it_is_scaled(source) -> None:
    a = source("a", ["diverged", 1.0])
    assert (3 * a.score()).of(a.trials[0]) == -math.inf
    assert (3 * a.score("lower")).of(a.trials[0]) == math.inf


def test_what_can_be_below_0_has_no_ratios(source) -> None:
    verdict = judge(source("a", [0.0, -3.0, 1.0]).score() * 2 > source("b", [1.0] * 3).score(), Design.fixed(3))
    assert verdict.outcome is Outcome.ERROR
    assert verdict.reason == "a: score is -3 in the trial of seed 1: a measure that can be below 0 has no ratios."


def test_an_exact_measure_is_described_and_hashed_as_ever(source) -> None:
    assert source("a", []).score().window == EVERYTHING
    assert "limit" not in source("a", []).score().plain()


@pytest.mark.parametrize(("factor", "of_a", "of_b"), [(0.1, 3.0, 0.3), (1.1, 3.0, 3.3), (3, 0.1, 0.3)])
def test_what_a_ratio_makes_equal_is_a_tie(source, factor, of_a, of_b) -> None:
    a, b = source("a", [of_a] * 10).score(), source("b", [of_b] * 10).score()
    for claim in (factor * a > b, b > factor * a, factor * a > of_b, factor * a < of_b):
        assert judge(claim, FIXED_10).outcome is not SUPPORTED
    assert factor * of_a != of_b  # as floats are multiplied


def test_a_trial_at_the_limit_is_at_the_scaled_limit(source) -> None:
    for tenths in range(1, 60):
        a = 0.1 * until(source, "a", [tenths / 10], Window(tenths / 10))
        trials = {a.source.fingerprint: tuple(a.source.fetch([0]))}
        assert a.sample(trials).values == (a.window.limit,)
