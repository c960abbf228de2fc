"""Making the report of a claim: judged, broken before that, skipped, or without a test at the tier."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from evoclaims.claims.claim import Claim, Expectation
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.design import Design
from evoclaims.judging.judge import attainability
from evoclaims.judging.verdict import Outcome, Verdict
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials.spec import TrialSpec
from evoclaims.verdicts.claim_report import Attainable, ClaimReport
from evoclaims.verdicts.source_trials import SourceTrials
from evoclaims.verdicts.versions import found_in


def judged(
    claim: Claim,
    case: str,
    tier: str,
    assertion: Assertion,
    design: Design,
    verdict: Verdict,
    again: Mapping[str, Collection[int]],
) -> ClaimReport:
    """Build the report of a claim that was judged; `again` holds the seeds that were run again, by condition id."""
    groups = [source for source in assertion.sources() if isinstance(source, TrialGroup)]
    seeds = design.seeds(verdict.n)
    return replace(
        _unjudged(claim, case, tier, verdict.outcome, verdict.reason),
        verdict=verdict,
        sources=tuple(_source(group, seeds, again.get(group.fingerprint, ())) for group in groups),
        attainable=tuple(
            Attainable(look.n, look.alpha, p.supported, p.refuted) for look, p in attainability(assertion, design)
        ),
    )


def broken(claim: Claim, case: str, tier: str, reason: str) -> ClaimReport:
    """Build the report of a claim whose test broke before it was judged."""
    return _unjudged(claim, case, tier, Outcome.ERROR, reason)


def skipped(claim: Claim, case: str, tier: str, reason: str) -> ClaimReport:
    """Build the report of a claim whose test was skipped, with pytest's reason."""
    return _unjudged(claim, case, tier, Outcome.NOT_RUN, f"its test was skipped ({reason or 'no reason given'})")


def without_instance(claim: Claim, case: str, tier: str, because: str) -> ClaimReport:
    """Build the report of a claim that has no test at a tier."""
    report = _unjudged(claim, case, tier, Outcome.NOT_RUN, f"it has no {tier} test: {because}")
    return replace(report, has_test=False)


def expecting(report: ClaimReport, expectation: Expectation | None) -> ClaimReport:
    """Add an accepted outcome to a report; what is accepted for the protocol is not for its variants."""
    if expectation is None or report.variant:
        return report
    return replace(report, expected=expectation.outcome, because=expectation.because)


def _unjudged(claim: Claim, case: str, tier: str, outcome: Outcome, reason: str) -> ClaimReport:
    """Build the report of a claim without a verdict of the judge."""
    return ClaimReport(
        claim=claim.id,
        case=case,
        tier=tier,
        statement=claim.statement(tier),
        where=claim.where,
        outcome=outcome,
        reason=reason,
    )


def _source(group: TrialGroup, seeds: Sequence[int], again: Collection[int]) -> SourceTrials:
    """Describe one condition of a report."""
    condition = group.condition
    return SourceTrials(
        method=group.method,
        task=group.task,
        condition=group.fingerprint,
        trials=tuple(TrialSpec(condition, seed).id for seed in seeds),
        versions=found_in(group.fetch(seeds), condition.packages) if seeds else {},
        again=tuple(sorted(again)),
    )
