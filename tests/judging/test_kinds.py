"""Each kind of assertion comes out as the table of the specification says."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce
from itertools import product
from operator import and_, or_
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, kendalltau

from evoclaims.judging.assertion import Finding
from evoclaims.judging.design import FIXED_10, Design, Look
from evoclaims.judging.judge import attainability, judge
from evoclaims.judging.kinds.most_trials import Solves
from evoclaims.judging.kinds.threshold import Threshold
from evoclaims.judging.kinds.trend import kendall_s
from evoclaims.judging.sample import Trials
from evoclaims.judging.verdict import Direction, Outcome, PValues

SUPPORTED, REFUTED, INCONCLUSIVE = Outcome.SUPPORTED, Outcome.REFUTED, Outcome.INCONCLUSIVE
SMALLER = Outcome.SMALLER
RISING = [float(i) for i in range(10)]


def shifted(by: float) -> list[float]:
    return [value + by for value in RISING]


@pytest.mark.parametrize(
    ("a", "b", "outcome"),
    [
        (shifted(20), RISING, SUPPORTED),
        (RISING, shifted(20), REFUTED),
        (shifted(0.5), RISING, INCONCLUSIVE),
        (RISING, shifted(0.5), INCONCLUSIVE),  # below in every pair of a seed, which are labels: A12 is 0.45
        (RISING, shifted(2.5), SMALLER),  # A12 is 0.28: the rank test does not reject, the claimed size is rejected
        (RISING, RISING, INCONCLUSIVE),
        (RISING, ["diverged"] * 10, SUPPORTED),
        (["diverged"] * 10, RISING, REFUTED),
    ],
)
def test_greater(source, a, b, outcome) -> None:
    verdict = judge(source("a", a).score() > source("b", b).score(), FIXED_10)
    assert verdict.outcome is outcome


def test_greater_reports_every_value_and_its_effect(source) -> None:
    verdict = judge(source("a", shifted(20)).score() > source("b", RISING).score(), FIXED_10)
    (evidence,) = verdict.evidence
    assert [sample.values for sample in evidence.samples] == [tuple(shifted(20)), tuple(RISING)]
    assert (evidence.n, evidence.a12, evidence.cliffs_delta) == (10, 1.0, 1.0)
    assert evidence.p == evidence.attainable_p == verdict.p == pytest.approx(5.4e-6, rel=0.01)
    assert evidence.outcome is SUPPORTED
    assert evidence.detail == "at least as high in 1 of all pairs of trials (p = 1 against A12 >= 0.71)"


@dataclass(frozen=True)
class BothWays(Solves):
    """A custom kind whose tests contradict each other."""

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        p = PValues(0.02, 0.02)
        return self.found(p, p, alpha, (self.event.sample(trials),), events=True)


def test_evidence_both_ways_decides_neither(source) -> None:
    verdict = judge(BothWays(source("a", [1.0] * 10).solved()), FIXED_10)
    assert (verdict.outcome, verdict.p, verdict.p_refuted) == (INCONCLUSIVE, 0.02, 0.02)
    assert "contradicts itself" in verdict.reason


def test_an_effect_that_is_shown_to_be_small_is_smaller_than_claimed(source) -> None:
    # A12 is 0.59 of 100 against 100: above, and below 0.71.
    a = [float(i) + 9 for i in range(100)]
    verdict = judge(source("a", a).score() > source("b", [float(i) for i in range(100)]).score(), Design.fixed(100))
    assert verdict.outcome is SMALLER
    assert verdict.p is not None
    assert verdict.decision is not None
    assert max(verdict.p, verdict.decision.p) <= 0.05
    assert verdict.decision.direction is Direction.SIZE
    assert "though it is above" in verdict.reason


@pytest.mark.parametrize(("n", "outcome"), [(30, INCONCLUSIVE), (32, REFUTED)])
def test_equality_within_the_margin_refutes_where_n_allows_it(source, n, outcome) -> None:
    values = [float(i) for i in range(0, 2 * n, 2)]
    other = [value + (1 if at % 2 else -1) for at, value in enumerate(values)]
    verdict = judge(source("a", values).score() > source("b", other).score(), Design.fixed(n))
    assert verdict.outcome is outcome


@pytest.mark.parametrize(
    ("successes", "outcome"), [(10, SUPPORTED), (9, INCONCLUSIVE), (5, INCONCLUSIVE), (4, REFUTED)]
)
@pytest.mark.parametrize("word", ["in_most_trials", "stays"])
def test_solves_and_stays(source, word, successes, outcome) -> None:
    event = source("a", [1.0] * successes + ["diverged"] * (10 - successes)).solved()
    verdict = judge(getattr(event, word)(), FIXED_10)
    assert verdict.outcome is outcome
    assert verdict.evidence[0].kind == {"in_most_trials": "solves", "stays": "stays"}[word]


def test_an_overriding_p0_takes_the_place_of_the_designs(source) -> None:
    event = source("a", [1.0] * 9 + [0.0]).solved()
    assert judge(event.in_most_trials(p0=0.5), FIXED_10).outcome is SUPPORTED
    assert judge(event.in_most_trials(), Design(FIXED_10.looks, p0=0.5)).outcome is SUPPORTED


@pytest.mark.parametrize(
    ("values", "outcome"),
    [
        ([5.0] * 10, SUPPORTED),
        ([4.0] * 5 + [6.0] * 5, SUPPORTED),
        ([5.0] * 9 + [0.0], SUPPORTED),
        ([5.0] * 8 + [0.0] * 2, INCONCLUSIVE),
        ([5.0] * 8 + [0.0, 9.0], SUPPORTED),  # nine at or above 4, nine at or below 6
        ([5.0] * 2 + [9.0] * 8, INCONCLUSIVE),
        ([5.0] + [9.0] * 9, REFUTED),
        ([5.0] + ["diverged"] * 9, REFUTED),
    ],
)
def test_band(source, values, outcome) -> None:
    assert judge(source("a", values).score().between(4, 6), FIXED_10).outcome is outcome


@pytest.mark.parametrize(("n", "outcome"), [(5, INCONCLUSIVE), (6, REFUTED)])
def test_a_band_is_refuted_at_half_of_alpha(source, n, outcome) -> None:
    # All five beyond one end have p = 0.031, all six 0.016; alpha / 2 is 0.025.
    assert judge(source("a", [9.0] * n).score().between(4, 6), Design.fixed(n)).outcome is outcome


@pytest.mark.parametrize(
    ("rows", "outcome"),
    [
        ([(1.0, 0.8, 0.6, 0.5)] * 10, SUPPORTED),
        ([(0.5, 0.6, 0.8, 1.0)] * 10, REFUTED),
        ([(1.0, 0.5, 0.5, 1.0)] * 10, INCONCLUSIVE),
        ([(0.9000000357627869, 0.9, 0.9, 0.9)] * 10, INCONCLUSIVE),  # but for rounding to single precision
        (["diverged"] * 10, INCONCLUSIVE),
        ([(1.0, 0.8, 0.6, 0.5)] + ["diverged"] * 9, INCONCLUSIVE),  # one trial is one draw, of however many levels
        ([(1.0, 0.8, 0.6, 0.5)] * 5 + [(0.5, 0.6, 0.8, 1.0)] * 5, INCONCLUSIVE),
        ([(1.0, 0.8, 0.9, 0.5)] * 9 + ["diverged"], SUPPORTED),
        ([(1.0, 0.8, 0.9, 0.5)] * 8 + [(1.0, 0.5, 0.5, 1.0)] * 2, INCONCLUSIVE),  # p = 0.055: a tie counts as not
    ],
)
def test_trend(source, rows, outcome) -> None:
    profile = source("a", rows).success(4)
    assert judge(profile.falls(), FIXED_10).outcome is outcome
    mirrored = {SUPPORTED: REFUTED, REFUTED: SUPPORTED, INCONCLUSIVE: INCONCLUSIVE}
    assert judge(profile.rises(), FIXED_10).outcome is mirrored[outcome]


@given(st.lists(st.sampled_from([-math.inf, 0.0, 0.5, 1.0]), max_size=6))
def test_kendalls_s_is_that_of_scipy(row: list[float]) -> None:
    """SciPy's tau-c is S times a number that depends on the sizes alone."""
    s = kendall_s(row)
    assert kendall_s([-value for value in row]) == kendall_s(row[::-1]) == -s
    distinct = len(set(row))
    if distinct > 1:
        tau = kendalltau(range(len(row)), [max(value, -1.0) for value in row], variant="c").statistic
        assert s == pytest.approx(tau * len(row) ** 2 * (distinct - 1) / distinct / 2)


def test_a_trend_reports_every_level(source) -> None:
    verdict = judge(source("a", [(1.0, 0.5)] * 9 + [(0.5, 0.5)]).success(2).falls(), FIXED_10)
    assert verdict.evidence[0].detail == "falls in 9 of 10 trials, rises in 0, and neither in 1"
    assert [sample.median for sample in verdict.evidence[0].samples] == [1.0, 0.5]


@pytest.mark.parametrize(
    ("a", "outcome"),
    [
        (RISING, SUPPORTED),
        (shifted(30), REFUTED),
        (shifted(-30), REFUTED),
        (shifted(8), INCONCLUSIVE),
        (["diverged"] * 10, REFUTED),
    ],
)
def test_equivalent(source, a, outcome) -> None:
    assertion = source("a", a).score().equivalent_to(source("b", RISING).score(), margin=8.0)
    assert judge(assertion, FIXED_10).outcome is outcome


@pytest.mark.parametrize(("a", "b", "margin"), [(0.1, 0.3, 0.2), (0.75, 0.7, 0.05), (0.3, 0.1, 0.2)])
def test_a_difference_as_large_as_the_margin_is_not_within_it(source, a, b, margin) -> None:
    assertion = source("a", [a] * 10).score().equivalent_to(source("b", [b] * 10).score(), margin=margin)
    assert judge(assertion, FIXED_10).outcome is INCONCLUSIVE


def test_equivalence_is_refuted_at_half_of_alpha(source) -> None:
    # Three against three: a complete separation has p = 0.05, which alpha / 2 does not allow.
    assertion = source("a", shifted(30)).score().equivalent_to(source("b", RISING).score(), margin=8.0)
    assert judge(assertion, Design.fixed(3)).outcome is INCONCLUSIVE


@pytest.mark.parametrize(("last", "outcome"), [(1.0, SUPPORTED), (0.0, REFUTED), ("diverged", REFUTED)])
def test_exact_needs_every_trial_and_reports_no_p(source, last, outcome) -> None:
    verdict = judge(source("a", [1.0, 1.0, last]).solved().in_every_trial(), Design.fixed(3))
    assert verdict.outcome is outcome
    assert verdict.p is verdict.evidence[0].p is None


@pytest.mark.parametrize(("n", "values"), [(6, RISING), (9, [1.0] * 10), (10, [0.0] * 5 + [9.0] * 5), (10, RISING)])
def test_no_condition_is_above_itself(source, n, values) -> None:
    verdict = judge(source("a", values).score().never_above_itself(), Design.fixed(n))
    assert verdict.outcome is SUPPORTED
    assert f"of {math.comb(n, n // 2)} splits" in verdict.reason


def test_beyond_ten_trials_a_fixed_sample_of_splits_is_judged(source) -> None:
    measure = source("a", [float(i) for i in range(14)]).score()
    verdicts = [judge(measure.never_above_itself(), Design.fixed(14)) for _ in range(2)]
    assert verdicts[0] == verdicts[1]
    assert verdicts[0].outcome is SUPPORTED
    assert "of 252 splits" in verdicts[0].reason


@pytest.mark.parametrize("n", [10, 14])
def test_the_control_catches_a_judge_that_cries_wolf(source, n, monkeypatch) -> None:
    from evoclaims.judging.exact import ExactTest
    from evoclaims.judging.kinds import greater

    real = greater.rank_test
    monkeypatch.setattr(greater, "rank_test", lambda a, b: ExactTest(real(a, b).p / 5, 0.0))
    measure = source("a", [float(i) for i in range(n)]).score()
    assert judge(measure.never_above_itself(), Design.fixed(n)).outcome is REFUTED


def test_the_control_is_underpowered_where_no_split_could_come_out_supported(source) -> None:
    verdict = judge(source("a", RISING).score().never_above_itself(), Design.fixed(5))
    assert verdict.outcome is INCONCLUSIVE
    assert "underpowered: needs n = 6" in verdict.reason


OUTCOMES = {SUPPORTED: [1.0] * 10, REFUTED: [0.0] * 10, INCONCLUSIVE: [1.0] * 8 + [0.0] * 2}


@pytest.mark.parametrize(("left", "right"), list(product(OUTCOMES, OUTCOMES)))
def test_and_needs_every_part_and_or_needs_one(source, left, right) -> None:
    a = source("a", OUTCOMES[left]).solved().in_most_trials(p0=0.6)
    b = source("b", OUTCOMES[right]).solved().in_most_trials(p0=0.6)
    both = {left, right}
    expected_and = REFUTED if REFUTED in both else SUPPORTED if both == {SUPPORTED} else INCONCLUSIVE
    expected_or = SUPPORTED if SUPPORTED in both else REFUTED if both == {REFUTED} else INCONCLUSIVE
    assert judge(a & b, FIXED_10).outcome is expected_and
    assert judge(a | b, FIXED_10).outcome is expected_or
    assert [entry.outcome for entry in judge(a & b, FIXED_10).evidence] == [left, right]


def test_a_part_that_contradicts_itself_decides_neither_and_nor_or(source) -> None:
    part = BothWays(source("a", [1.0] * 10).solved())
    holds = [source(f"holds {i}", [1.0] * 10).solved().in_most_trials() for i in range(3)]
    fails = [source(f"fails {i}", [0.0] * 10).solved().in_most_trials() for i in range(3)]
    undecided = judge(reduce(and_, holds, part), FIXED_10)
    assert (undecided.outcome, undecided.deciding) == (INCONCLUSIVE, 0)
    assert judge(reduce(or_, fails, part), FIXED_10).outcome is INCONCLUSIVE
    assert judge(part & fails[0], FIXED_10).outcome is REFUTED
    assert judge(part | holds[0].event.in_every_trial(), FIXED_10).outcome is SUPPORTED


def test_a_compound_is_smaller_than_claimed_where_a_part_is(source) -> None:
    small = source("a", RISING).score() > source("b", shifted(3.5)).score()
    holds, fails = (source(n, [v] * 10).solved().in_most_trials(p0=0.5) for n, v in (("c", 1.0), ("d", 0.0)))
    assert judge(small, FIXED_10).outcome is REFUTED
    small = source("a", RISING).score() > source("b", shifted(2.5)).score()
    assert [judge(one, FIXED_10).outcome for one in (small, small & holds, small | fails)] == [SMALLER] * 3
    assert judge(small & fails, FIXED_10).outcome is REFUTED
    assert judge(small | holds, FIXED_10).outcome is SUPPORTED
    both = judge(small & holds, FIXED_10)
    assert (both.deciding, both.decision.p) == (0, pytest.approx(2 * judge(small, FIXED_10).p_smaller))


def test_or_pays_holms_correction_where_it_is_supported_and_and_where_it_is_refuted(source) -> None:
    # 10 of 10 against 0.7 has p = 0.028: enough alone and for "and", not as the better of two.
    a, b = source("a", [1.0] * 10).solved().stays(), source("b", [1.0] * 10).solved().stays()
    assert judge(a & b, FIXED_10).outcome is SUPPORTED
    verdict = judge(a | b, FIXED_10)
    assert verdict.outcome is INCONCLUSIVE
    assert verdict.p == pytest.approx(2 * 0.7**10)
    # 4 of 10 against 0.7 has p = 0.047: enough to refute one event, or one of two, not both together.
    a, b = (source(name, [1.0] * 4 + [0.0] * 6).solved().stays() for name in "ab")
    assert judge(a, FIXED_10).outcome is judge(a | b, FIXED_10).outcome is REFUTED
    verdict = judge(a & b, FIXED_10)
    assert verdict.outcome is INCONCLUSIVE
    assert verdict.p_refuted == pytest.approx(2 * binom.cdf(4, 10, 0.7))
    assert attainability(a & b, FIXED_10)[-1][1].refuted == pytest.approx(2 * 0.3**10)


@pytest.mark.parametrize(
    ("values", "above", "below"),
    [
        ([91.0] * 10, SUPPORTED, REFUTED),
        ([91.0] * 9 + [0.0], SUPPORTED, REFUTED),
        ([91.0] * 8 + [0.0] * 2, INCONCLUSIVE, INCONCLUSIVE),
        ([89.0] * 10, REFUTED, SUPPORTED),
        ([91.0] * 9 + [90.0], SUPPORTED, REFUTED),  # p = 11 / 1024: a tie is not above
        ([91.0] * 8 + [90.0] * 2, INCONCLUSIVE, INCONCLUSIVE),
        ([90.0] * 10, INCONCLUSIVE, INCONCLUSIVE),
        ([91.0] * 9 + ["diverged"], SUPPORTED, REFUTED),
        (["diverged"] * 10, REFUTED, INCONCLUSIVE),  # a broken run supports nothing
    ],
)
def test_a_median_against_a_number(source, values, above, below) -> None:
    score = source("a", values).score()
    assert judge(score > 90, FIXED_10).outcome is above
    assert judge(score < 90, FIXED_10).outcome is below


def test_the_evidence_says_which_trials_decide_nothing(source) -> None:
    score = source("a", [91.0] * 6 + [90.0] + [80.0] * 2 + ["diverged"]).score()
    (above,), (below,) = judge(score > 90, FIXED_10).evidence, judge(score < 90, FIXED_10).evidence
    assert above.detail == "6 of 10 above 90, 3 below, 1 at it or without a result, which count for neither"
    assert below.detail == "2 of 10 below 90, 6 above, 2 at it or without a result, which count for neither"
    assert [(bound.name, bound.value) for bound in above.bounds] == [("number", 90.0)]
    assert above.describe == "the median of a: score is above 90"


def test_where_all_trials_are_at_the_number_nothing_was_attainable(source) -> None:
    verdict = judge(source("a", [90.0] * 10).score() > 90, FIXED_10)
    assert verdict.reason == "all 10 trials have the value 90: nothing to compare"


NINE_OF_TEN, SEVEN_OF_TEN = 0.9000000357627869, 0.699999988079071
"""As XLA computes the means of ten episodes."""


@pytest.mark.parametrize(
    ("values", "claim", "outcome"),
    [
        (NINE_OF_TEN, lambda a, b: a > 0.9, INCONCLUSIVE),
        (SEVEN_OF_TEN, lambda a, b: a < 0.7, INCONCLUSIVE),
        (SEVEN_OF_TEN, lambda a, b: a.between(0.7, 1), SUPPORTED),
        (NINE_OF_TEN, lambda a, b: a.between(0, 0.9), SUPPORTED),
        (NINE_OF_TEN, lambda a, b: a > b, INCONCLUSIVE),  # of a training loop, which has 64 bits
        (NINE_OF_TEN, lambda a, b: b < a, INCONCLUSIVE),
        (0.9001, lambda a, b: a > 0.9, SUPPORTED),
        (0.9001, lambda a, b: a > b, SUPPORTED),
        (2**24 + 1.0, lambda a, b: a > 2**24, SUPPORTED),  # counts are exact
    ],
)
def test_rounding_to_single_precision_decides_nothing(source: Any, values: float, claim: Any, outcome: Outcome) -> None:
    measures = source("a", [values] * 10).score(), source("b", [0.9] * 10).score()
    assert judge(claim(*measures), FIXED_10).outcome is outcome


def test_a_chain_of_neighbours_that_are_alike_makes_numbers_far_apart_no_equals(source: Any) -> None:
    chain = [0.5 * (1 + 8e-7) ** k for k in range(20)]
    low, high = source("a", chain[:10]).score(), source("b", chain[10:]).score()
    assert judge(high > low, FIXED_10).outcome is SUPPORTED


@pytest.mark.parametrize(("n", "alpha"), [(5, 0.05), (6, 0.05), (7, 0.01)])
@pytest.mark.parametrize("at", [0.0, 0.1, 0.5])
def test_no_median_at_the_number_is_called_above_or_below_more_often_than_alpha(
    source: Any, n: int, alpha: float, at: float
) -> None:
    chances = {91.0: 0.5, 90.0: at, 89.0: 0.5 - at}  # the edge of the null: a median at the number
    errors = dict.fromkeys(Outcome, 0.0)
    for counts in product(range(n + 1), repeat=2):
        if sum(counts) <= n:
            above, tied = counts
            values = [91.0] * above + [90.0] * tied + [89.0] * (n - above - tied)
            ways = math.comb(n, above) * math.comb(n - above, tied)
            chance = ways * math.prod(chances[value] for value in values)
            errors[judge(source("a", values).score() > 90, Design.fixed(n, alpha)).outcome] += chance
    assert errors[SUPPORTED] <= alpha
    assert errors[REFUTED] <= alpha


@pytest.mark.parametrize("side", ["above", "below"])
def test_a_verdict_that_comes_early_is_that_of_all_trials(source: Any, side: Any) -> None:
    ends = set()
    for values in np.random.default_rng(0).choice([89.0, 90.0, 91.0, 92.0], size=(60, 10)).tolist():
        claim = Threshold(source("a", values).score(), side, 90.0)
        early, all_ten = judge(claim, Design((Look(7, 0.01), Look(10, 0.04)))), judge(claim, Design.fixed(10, 0.04))
        ends.add(early.n)
        if early.n == 10 or "stopped early" in early.reason:
            assert early.outcome is all_ten.outcome
    assert ends == {7, 10}
