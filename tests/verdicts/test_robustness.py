"""Which claims end otherwise under a variant."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hand_made_verdicts import report

from evoclaims.judging.verdict import Outcome, Verdict
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.transitions import matrix


def _report(claim: str, outcome: Outcome, variant: str = "", tier: str = "smoke") -> ClaimReport:
    return report(claim, outcome, tier=tier, variant=variant)


PLAIN = [_report("A", Outcome.SUPPORTED), _report("B", Outcome.REFUTED), _report("C", Outcome.NOT_RUN)]


def test_claims_that_no_variant_judged_are_left_out() -> None:
    variants = {"x": [_report("A", Outcome.NOT_RUN, "x"), _report("B", Outcome.REFUTED, "x")], "y": []}
    (row,) = matrix(PLAIN, variants)
    assert (row.claim, row.outcomes, row.hangs_on) == ("B", {"x": Outcome.REFUTED}, ())


@pytest.mark.parametrize("plain", Outcome)
@pytest.mark.parametrize("varied", [outcome for outcome in Outcome if outcome is not Outcome.NOT_RUN])
def test_a_claim_hangs_on_a_variant_where_both_have_run_and_their_verdicts_differ(
    plain: Outcome, varied: Outcome
) -> None:
    (row,) = matrix([_report("A", plain)], {"x": [_report("A", varied, "x")]})
    assert (row.plain, row.outcomes) == (plain, {"x": varied})
    assert row.hangs_on == (("x",) if plain is not Outcome.NOT_RUN and plain is not varied else ())


def test_tiers_are_kept_apart() -> None:
    assert matrix(PLAIN[:1], {"x": [_report("A", Outcome.REFUTED, "x", tier="full")]}) == ()


def test_a_variant_that_is_inconclusive_with_fewer_trials_says_nothing_of_the_detail() -> None:
    """The protocol itself was inconclusive at ten trials, before thirty decided."""

    def judged(outcome: Outcome, n: int) -> ClaimReport:
        report = _report("A", outcome)
        return replace(report, verdict=Verdict(outcome, "", "", "f", n=n))

    undecided, refuted = judged(Outcome.INCONCLUSIVE, 10), judged(Outcome.REFUTED, 10)
    (row,) = matrix([judged(Outcome.SUPPORTED, 30)], {"x": [undecided], "y": [refuted]})
    assert (row.hangs_on, row.fewer) == (("y",), {"x"})
    (row,) = matrix([judged(Outcome.SUPPORTED, 10)], {"x": [undecided]})
    assert row.hangs_on == ("x",)
    (row,) = matrix([judged(Outcome.INCONCLUSIVE, 30)], {"x": [undecided]})
    assert (row.hangs_on, row.fewer) == ((), frozenset())
