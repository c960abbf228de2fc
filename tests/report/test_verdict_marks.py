"""Marks of a sentence's cases."""

from __future__ import annotations

from hand_made_verdicts import report

from evoclaims.report.verdict_overview import mark


def test_support_that_a_null_agent_has_too_is_in_brackets() -> None:
    cases = [report(case="a", satisfied_by=("random",)), report(case="b"), report(case="c", outcome="refuted")]
    assert mark(cases) == "✓1 (✓)1 ✗1"
    assert mark(cases[:1]) == "(✓)"
