"""Making the report of a claim: judged, broken before that, skipped, or without a test at the tier."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from evoclaims.claims.claim import Expectation
from evoclaims.claims.collected import ClaimTest
from evoclaims.core.canonical import content_hash
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.design import Design
from evoclaims.judging.judge import attainability
from evoclaims.judging.verdict import Outcome, Verdict
from evoclaims.paper.pilots import read_of
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials.spec import TrialSpec
from evoclaims.verdicts.claim_report import Attainable, ClaimReport
from evoclaims.verdicts.source_trials import SourceTrials
from evoclaims.verdicts.versions import found_in


def judged(
    test: ClaimTest, assertion: Assertion, design: Design, verdict: Verdict, again: Mapping[str, Collection[int]]
) -> ClaimReport:
    """Build the report of a claim that was judged; `again` holds the seeds that were run again, by condition id."""
    groups = [source for source in assertion.sources() if isinstance(source, TrialGroup)]
    seeds = design.seeds(verdict.n)
    return replace(
        unjudged(test, verdict.outcome, verdict.reason),
        verdict=verdict,
        asserts=content_hash(assertion.plain()),
        sources=tuple(_source(group, seeds, again.get(group.fingerprint, ()), assertion) for group in groups),
        attainable=tuple(
            Attainable(look.n, look.alpha, p.supported, p.refuted, p.smaller)
            for look, p in attainability(assertion, design)
        ),
    )


def unjudged(test: ClaimTest, outcome: Outcome, reason: str, *, has_test: bool = True) -> ClaimReport:
    """Build the report of a claim without a verdict: its test broke or was skipped, or this tier has no test."""
    return ClaimReport(
        claim=test.claim.id,
        case=test.case,
        tier=test.tier,
        statement=test.claim.statement(test.tier) if has_test else test.claim.says,
        where=test.claim.where,
        outcome=outcome,
        reason=reason,
        has_test=has_test,
        line=test.claim.line,
    )


def expecting(report: ClaimReport, expectation: Expectation | None) -> ClaimReport:
    """Add an accepted outcome to a report; what is accepted for the protocol is not for its variants."""
    if expectation is None or report.variant:
        return report
    return replace(report, expected=expectation.outcome, because=expectation.because)


def _source(group: TrialGroup, seeds: Sequence[int], again: Collection[int], assertion: Assertion) -> SourceTrials:
    """Describe one condition of a report."""
    condition = group.condition
    trials = group.fetch(seeds) if seeds else ()
    readings = [reading for reading in assertion.readings() if reading.source.fingerprint == group.fingerprint]
    finished = [trial for trial in trials if trial.status == "done"]
    return SourceTrials(
        method=group.method,
        task=group.task,
        condition=group.fingerprint,
        trials=tuple(TrialSpec(condition, seed).id for seed in seeds),
        versions=found_in(trials, condition.packages) if seeds else {},
        again=tuple(sorted(again)),
        edited=condition.edited_since(trials),
        reads=read_of(finished[0], readings) if finished else (),
    )
