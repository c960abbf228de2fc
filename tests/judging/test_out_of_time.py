"""Trials that ran out of time could have had any result: they alone decide nothing, in any kind and direction."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest

from evoclaims.judging.design import FIXED_10, SEQUENTIAL, Design, Look
from evoclaims.judging.judge import judge
from evoclaims.judging.verdict import Outcome

SUPPORTED, REFUTED, INCONCLUSIVE = Outcome.SUPPORTED, Outcome.REFUTED, Outcome.INCONCLUSIVE
HIGH = [float(i) + 20 for i in range(10)]
LOW = [float(i) for i in range(10)]
NEVER = ["timeout"] * 10
AT_4 = Design.fixed(10, 0.04)


def claims(a, b):  # type: ignore[no-untyped-def]
    """Assertions of every kind about the first source."""
    measure, other = a.score(), b.score()
    return {
        "above": measure > other,
        "below": measure < other,
        "equivalent": measure.equivalent_to(other, margin=5),
        "band": measure.between(0, 30),
        "threshold": measure > 5,
        "threshold, low": measure < 5,
        "solves": a.solved().in_most_trials(),
        "stays": a.solved().stays(),
        "exact": a.solved().in_every_trial(),
        "control": measure.never_above_itself(),
        "and": (measure > other) & a.solved().stays(),
        "or": (measure < other) | a.solved().stays(),
    }


@pytest.mark.parametrize("design", [FIXED_10, SEQUENTIAL])
def test_trials_that_all_ran_out_of_time_decide_no_kind(source, design) -> None:
    for name, claim in claims(source("a", NEVER), source("b", HIGH)).items():
        verdict = judge(claim, design)
        assert verdict.outcome is INCONCLUSIVE, name
    for name, claim in claims(source("b", HIGH), source("a", NEVER)).items():
        if name in ("above", "below", "equivalent"):
            assert judge(claim, design).outcome is INCONCLUSIVE, name
    assert judge(source("a", [(1.0, 0.0)] * 0 + NEVER).success(2).falls(), design).outcome is INCONCLUSIVE


def test_the_reason_names_them_and_what_they_could_change(source) -> None:
    verdict = judge(source("a", ["timeout"] * 8 + [1.0] * 2).solved().in_most_trials(), FIXED_10)
    assert verdict.outcome is INCONCLUSIVE
    assert verdict.reason.startswith("8 of 10 trials of a ran out of time (seeds 0, 1, 2, 3, 4, 5, 6, 7); with other")
    assert "need not be refuted (p up to 1)" in verdict.reason


def test_what_the_others_show_is_decided_whatever_they_would_have_been(source) -> None:
    few = ["timeout", *LOW[1:]]
    assert judge(source("a", few).score() > source("b", HIGH).score(), FIXED_10).outcome is REFUTED
    assert judge(source("b", HIGH).score() > source("a", few).score(), FIXED_10).outcome is SUPPORTED
    assert judge(source("a", [0.0] * 8 + ["timeout"] * 2).solved().in_most_trials(), FIXED_10).outcome is REFUTED
    assert judge(source("a", [0.0, *["timeout"] * 9]).solved().in_every_trial(), FIXED_10).outcome is REFUTED
    assert judge(source("a", ["timeout", *HIGH[1:]]).score() > 5, FIXED_10).outcome is SUPPORTED


def test_what_is_smaller_than_claimed_may_be_refuted_by_their_results(source) -> None:
    b = [3.5 + one for one in range(9)]
    ends = [
        judge(source("a", LOW).score() > source("b", [*b, x]).score(), AT_4).outcome for x in (-9.0, 99.0, "timeout")
    ]
    assert ends == [Outcome.SMALLER, REFUTED, INCONCLUSIVE]


def test_a_decision_beside_copies_is_that_of_every_result(source) -> None:
    draw, decided = random.Random(1), 0
    for _ in range(100):
        a, b = [draw.gauss(1.3, 1) for _ in range(10)], [draw.gauss(0, 1) for _ in range(9)]
        a[1] = a[0]

        def ends(last: object, a: list[float] = a, b: list[float] = b) -> Outcome:
            one = source("a", a)
            for seed in (0, 1):
                one.trials[seed] = replace(one.trials[seed], champion="c" * 64, curves={"fitness": (0.857,)})
            return judge(one.score() > source("b", [*b, last]).score(), AT_4).outcome

        outcome = ends("timeout")
        if outcome is not INCONCLUSIVE:
            decided += 1
            assert {ends(99.0), ends(-99.0)} == {outcome}
    assert decided > 5


def test_copies_beside_them_decide_nothing_either(source) -> None:
    """Nine distinct trials count, of which eight ran out of time: 0 of 9 would refute."""
    a = source("a", [0.0, 0.0, *["timeout"] * 8])
    for seed in (0, 1):
        a.trials[seed] = replace(a.trials[seed], champion="c" * 64, curves={"fitness": (0.857,)})
    verdict = judge(a.solved().in_most_trials(), FIXED_10)
    assert verdict.outcome is INCONCLUSIVE
    assert "a has copies of the same training (seeds 0, 1)" in verdict.reason
    assert "8 of 9 trials of a ran out of time" in verdict.reason


def test_one_of_two_parts_without_them_refutes_both(source) -> None:
    without, failing = source("a", NEVER), source("b", [0.0] * 10)
    assert judge(without.solved().stays() & failing.solved().stays(), FIXED_10).outcome is REFUTED
    assert judge(without.solved().stays() | failing.solved().stays(), FIXED_10).outcome is INCONCLUSIVE


def test_a_later_look_may_decide_what_an_early_one_left_to_them(source) -> None:
    design = Design((Look(5, 0.01), Look(10, 0.04)))
    verdict = judge(source("a", ["timeout", *[0.0] * 9]).solved().in_most_trials(), design)
    assert (verdict.outcome, verdict.n) == (REFUTED, 10)
