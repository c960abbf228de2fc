"""The hash of everything that is fixed before the trials, so that no change goes unnoticed."""

from __future__ import annotations

from evoclaims.core.canonical import content_hash
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.design import Design

JUDGING_REVISION = 2
"""Raised when what a kind's tests are about changes, so that old verdicts do not count as new ones.

Not for another test of the same hypotheses, α and margin: changed verdicts are then entered under their fingerprint,
such as those of 2026-11-26, when pairs of seeds gave way to all pairs (docs/judging.md lists them).
"""


def fingerprint(assertion: Assertion, design: Design, *, claim: str = "", tier: str = "") -> str:
    """Return the fingerprint of a claim, such as "G1", in a tier: 64 hexadecimal digits.

    It hashes the assertion's kind, measures and margins, with the ids of its conditions, and all of the design.
    """
    return content_hash(
        {
            "judging": JUDGING_REVISION,
            "claim": claim,
            "tier": tier,
            "assertion": assertion.plain(),
            "protocol": design,  # the key of every fingerprint committed so far
        }
    )
