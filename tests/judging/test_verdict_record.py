"""Verdicts as records: strict JSON and one symbol an outcome."""

from __future__ import annotations

import json

from evoclaims.judging.judge import judge
from evoclaims.judging.protocol import FIXED_10
from evoclaims.judging.verdict import Outcome


def test_each_outcome_has_its_symbol() -> None:
    assert {str(outcome): outcome.symbol for outcome in Outcome} == {
        "supported": "✓",
        "refuted": "✗",
        "inconclusive": "?",
        "error": "E",
        "not run": "-",
    }


def test_a_verdict_is_strict_json_even_with_failed_trials(source) -> None:
    verdict = judge(source("a", ["diverged"] * 10).score() > source("b", [1.0] * 10).score(), FIXED_10)
    plain = json.loads(json.dumps(verdict.to_json(), allow_nan=False))
    assert plain["outcome"] == "refuted"
    assert plain["evidence"][0]["samples"][0]["values"] == ["-inf"] * 10
    assert plain["evidence"][0]["samples"][0]["failed"] == list(range(10))
    assert plain["fingerprint"] == verdict.fingerprint
