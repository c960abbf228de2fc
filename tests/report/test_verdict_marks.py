"""Marks of a sentence's cases."""

from __future__ import annotations

import hand_made_verdicts
from hand_made_verdicts import report
from laboratory import Laboratory

from evoclaims.report.trial_summary import Reader
from evoclaims.report.verdict_overview import mark, overview


def test_support_that_a_null_agent_has_too_is_in_brackets() -> None:
    cases = [report(case="a", satisfied_by=("random",)), report(case="b"), report(case="c", outcome="refuted")]
    assert mark(cases) == "✓1 (✓)1 ✗1"
    assert mark(cases[:1]) == "(✓)"


def test_cases_that_are_not_judged_stand_beside_those_that_are() -> None:
    lacking = report(case="a", outcome="not run")
    assert mark([report(case="b"), lacking]) == "✓1 –1"
    assert mark([lacking]) == "–"


def test_where_copies_count_once_the_numbers_are_of_the_trials_that_count(lab: Laboratory) -> None:
    counted = hand_made_verdicts.evidence(0.75, n=8)
    judged = hand_made_verdicts.verdict(n=10, evidence=(counted,), deciding=0)
    text = overview({"smoke": [report("G1", verdict=judged)]}, {"G1": "It solves"}, Reader(lab.archive))
    assert "A12 0.75, 8 trials a side" in text
