"""Verdicts as records: one symbol an outcome, and all that a reader of the evidence needs to know."""

from __future__ import annotations

import pytest

from evoclaims.core.errors import UserError
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.design import FIXED_10, Design
from evoclaims.judging.judge import judge
from evoclaims.judging.verdict import Bound, Direction, Outcome, PValues

RISING = [float(i) for i in range(10)]


def test_each_outcome_has_its_symbol() -> None:
    assert {str(outcome): outcome.symbol for outcome in Outcome} == {
        "supported": "✓",
        "refuted": "✗",
        "smaller than claimed": "↓",
        "inconclusive": "?",
        "error": "E",
        "not run": "-",
    }


def test_a_sample_says_how_each_failed_trial_ended(source) -> None:
    verdict = judge(source("a", [1.0, "diverged", 0.0, "timeout"]).solved().stays(), Design.fixed(4))
    (sample,) = verdict.evidence[0].samples
    assert (sample.failed, sample.endings) == ((1, 3), ("diverged", "timeout"))


def test_evidence_carries_what_its_trials_are_compared_with(source) -> None:
    a, b = source("a", RISING), source("b", RISING)
    bounds = {
        a.score().between(4, 6): (Bound("lowest", 4.0), Bound("highest", 6.0)),
        a.solved().in_most_trials(): (Bound("p0", 0.7),),
        a.solved().stays(p0=0.5): (Bound("p0", 0.5),),
        a.score() > b.score(): (Bound("A12 margin", 0.71, on_axis=False),),
        a.score().equivalent_to(b.score(), margin=2): (Bound("margin", 2.0, on_axis=False),),
        a.solved().in_every_trial(): (),
    }
    for assertion, expected in bounds.items():
        assert judge(assertion, FIXED_10).evidence[0].bounds == expected
    events = {entry.events for one in bounds if "solved" in one.describe() for entry in judge(one, FIXED_10).evidence}
    assert events == {True}
    assert judge(a.score().between(4, 6), FIXED_10).evidence[0].events is False


def test_a_verdict_rests_on_the_p_of_its_own_direction(source) -> None:
    a, b = source("a", RISING).score(), source("b", [value + 20 for value in RISING]).score()
    for verdict, direction in ((judge(a < b, FIXED_10), Direction.FOR), (judge(a > b, FIXED_10), Direction.AGAINST)):
        assert verdict.decision is not None
        assert verdict.decision.direction is direction
        assert verdict.decision.p == verdict.decision.attainable_p < 1e-5
    assert judge(source("a", [1.0] * 10).solved().in_every_trial(), FIXED_10).decision is None


def test_a_compound_that_a_fact_decides_has_no_p_of_a_test(source) -> None:
    sound = source("a", RISING).score()
    fails = source("b", [1.0] * 9 + [0.0]).solved().in_every_trial()
    verdict = judge((sound < source("c", [value + 20 for value in RISING]).score()) & fails, FIXED_10)
    assert (verdict.outcome, verdict.decision, verdict.p_refuted) == (Outcome.REFUTED, None, None)
    assert verdict.reason == f"{fails.describe()}: does not hold for seeds 9"
    verdict = judge(source("d", [1.0] * 10).solved().in_every_trial() | (sound > 5), FIXED_10)
    assert (verdict.outcome, verdict.decision) == (Outcome.SUPPORTED, None)


def test_the_part_that_decided_is_named_whatever_the_compound(source) -> None:
    yes, no, open_ = (
        source(name, [1.0] * held + [0.0] * (10 - held)).solved().in_most_trials(p0=0.6)
        for name, held in (("yes", 10), ("no", 1), ("open", 7))
    )

    def decided_by(assertion: Assertion) -> str:
        part = judge(assertion, FIXED_10).deciding_part
        assert part is not None
        return part.describe.partition(":")[0]

    assert decided_by(yes) == "yes"
    assert decided_by(yes & no & open_) == "no"
    assert decided_by(yes & open_) == "open"
    assert decided_by(open_ | yes) == "yes"
    assert decided_by(no | open_) == "open"
    assert decided_by((yes | open_) & (yes & no)) == "no"
    assert decided_by((no & yes) | (open_ & yes)) == "open"
    assert judge(yes, Design.fixed(1)).deciding_part is None


@pytest.mark.parametrize("p", [(2.0, 0.0), (0.0, -1.0), (float("nan"), 0.5)])
def test_a_p_value_that_is_no_probability_is_refused(p: tuple[float, float]) -> None:
    with pytest.raises(UserError, match="A p value is .* It must be between 0 and 1"):
        PValues(*p)
