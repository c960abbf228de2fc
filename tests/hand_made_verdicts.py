"""Verdicts made by hand: what the tests of tables, exports and histories show without judging anything."""

from __future__ import annotations

from typing import Any

from evoclaims.judging.verdict import Evidence, Outcome, Verdict
from evoclaims.verdicts.claim_report import ClaimReport


def evidence(a12: float | None = None, **fields: Any) -> Evidence:
    """Return a part of a verdict; of its numbers, only the effect says something."""
    basis = {"kind": "greater", "describe": "a > b", "outcome": Outcome.SUPPORTED, "samples": (), "n": 10}
    ps = dict.fromkeys(("p", "attainable_p", "p_refuted", "attainable_p_refuted"))
    return Evidence(**{**basis, "alpha": 0.05, **ps, "a12": a12, **fields})


def verdict(outcome: str = "supported", **fields: Any) -> Verdict:
    """Return the verdict of ten trials a side, whose p values differ so that a reader can tell them apart."""
    ps = {"p": 0.0283, "attainable_p": 0.0282, "p_refuted": 0.0043, "attainable_p_refuted": 0.0042}
    basis = {"outcome": Outcome(outcome), "reason": "for a reason", "describe": "a > b", "fingerprint": "f" * 64}
    return Verdict(**{**basis, "n": 10, "alpha": 0.05, **ps, **fields})


def report(claim: str = "G1", outcome: str = "supported", *, expected: str | None = None, **fields: Any) -> ClaimReport:
    """Return the report of a claim of the smoke tier that was judged; `verdict=None` for one that was not."""
    basis = {"case": "", "tier": "smoke", "statement": "All levels are solved", "where": "§5.1"}
    accepted = None if expected is None else Outcome(expected)
    whole = {"reason": "for a reason", "verdict": verdict(outcome), "expected": accepted}
    return ClaimReport(**{**basis, **whole, "claim": claim, "outcome": Outcome(outcome), **fields})
