"""A measure against a number: the sign test, ties at the number, and what is not observed."""

from __future__ import annotations

import math
from itertools import product
from typing import Any

import numpy as np
import pytest

from evoclaims.judging.design import FIXED_10, Design, Look
from evoclaims.judging.judge import judge
from evoclaims.judging.kinds.threshold import Threshold
from evoclaims.judging.verdict import Outcome

SUPPORTED, REFUTED, INCONCLUSIVE = Outcome.SUPPORTED, Outcome.REFUTED, Outcome.INCONCLUSIVE


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
