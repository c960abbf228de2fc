"""From a claim's assertion and trials to its report: what no pytest, no store and no file takes part in."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from evoclaims.claims.claim import ClaimTest, Expectation
from evoclaims.claims.fetching import NotStoredError
from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UserError, in_one_line
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.design import Design
from evoclaims.judging.judge import Fetch, attainability, decide, fetch_from, fingerprint, judge
from evoclaims.judging.power import Draws
from evoclaims.judging.verdict import Outcome, Verdict
from evoclaims.paper import pilots
from evoclaims.paper.pilots import read_of
from evoclaims.paper.reproduction import Reproduction
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import TrialSpec
from evoclaims.verdicts.claim_report import Attainable, ClaimReport
from evoclaims.verdicts.readings import ReadAs
from evoclaims.verdicts.source_trials import SourceTrials, found_in


@dataclass(frozen=True)
class Reading:
    """A reading of a claim's sentence, not yet judged; `ReadAs` has its parts after that."""

    name: str
    assertion: Assertion
    because: str
    since: str


def report_of(
    test: ClaimTest,
    assertion: Assertion,
    design: Design,
    trials: Fetch,
    again: Mapping[str, Collection[int]] | None = None,
) -> ClaimReport:
    """Have a claim's assertion judged; trials that may not be run make the verdict "not run".

    Args:
        test: the claim, its tier and case.
        assertion: what its test has passed to `verdict(...)`.
        design: the looks of the tier.
        trials: gets them.
        again: seeds that were run again because of their versions, by the condition's id; read after judging.
    """
    try:
        verdict = judge(assertion, design, trials, claim=test.name, tier=test.tier)
    except NotStoredError as error:
        of = next((f"{one.label}: " for one in assertion.sources() if one.fingerprint == error.condition), "")
        return without_trials(test, assertion, design, f"{of}{error}")
    return _report(test, assertion, design, verdict, trials, again or {})


def without_trials(test: ClaimTest, assertion: Assertion, design: Design, reason: str) -> ClaimReport:
    """Return the report of a claim that is not judged: "not run", with what is fixed beforehand."""
    mark = fingerprint(assertion, design, claim=test.name, tier=test.tier)
    verdict = Verdict(Outcome.NOT_RUN, reason, assertion.describe(), mark)
    return _report(test, assertion, design, verdict, fetch_from, {})


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


def broken(test: ClaimTest, error: BaseException, root: Path) -> ClaimReport:
    """Return the report of a claim whose test, or judging, has raised something in the project `root`."""
    text = str(error).strip().splitlines() if isinstance(error, UserError) else []
    return unjudged(test, Outcome.ERROR, text[0] if text else in_one_line(error, root))


def expecting(report: ClaimReport, expectation: Expectation | None) -> ClaimReport:
    """Add an accepted outcome to a report; what is accepted for the protocol is not for its variants."""
    if expectation is None or report.variant:
        return report
    return replace(report, expected=expectation.outcome, because=expectation.because)


def read_as(reading: Reading, design: Design, trials: Fetch, outcome: Outcome | None = None) -> ReadAs:
    """Judge a reading by the trials at hand; its outcome is given if it has been judged already."""
    started: list[str] = []
    try:
        ending = decide(reading.assertion, design, trials)
        if ending is not None:
            looked_at = [trial for several in ending.trials.values() for trial in several]
            started = [str(trial.timing["started"]) for trial in looked_at if "started" in trial.timing]
        found = Outcome.INCONCLUSIVE if ending is None else ending.outcome
    except NotStoredError:
        found = Outcome.NOT_RUN
    asserts, since = reading.assertion.describe(), min(started, default="")
    return ReadAs(reading.name, reading.because, reading.since, asserts, outcome or found, since)


def chance_of_inconclusive(assertion: Assertion, design: Design, paper: Reproduction, tier: str) -> float | None:
    """Return how often an assertion is inconclusive in draws from its pilots; None if one lacks a sound pilot."""
    found: dict[str, tuple[TrialResult, ...]] = {}
    second = pilots.has_second(paper.folder, tier)
    for group in assertion.sources():
        if not isinstance(group, TrialGroup):
            return None
        readings = [one for one in assertion.readings() if one.source.fingerprint == group.fingerprint]
        found[group.fingerprint] = pilots.load(
            pilots.path_of(paper.folder, tier, group.method, group.task, second=second)
        )
        if pilots.unfit(found[group.fingerprint], group.condition, design, readings):
            return None
    outcomes = list(Draws(found).outcomes(assertion, design))
    return outcomes.count(Outcome.INCONCLUSIVE) / len(outcomes)


def crash_shown_by(report: ClaimReport, assertion: Assertion) -> ClaimReport:
    """Return a report that names the command which runs its crashed trials alone, if any crashed."""
    groups = [source for source in assertion.sources() if isinstance(source, TrialGroup)]
    crashed = [one for one in groups if f"trials of {one.label} crashed" in report.reason]
    if report.verdict is None or report.outcome is not Outcome.ERROR or not crashed:
        return report
    shown = f"`evoclaims run {crashed[0].method} --on {crashed[0].task} --tier {report.tier}`"
    reason = f"{report.reason}; {shown} shows its last output"
    return replace(report, reason=reason, verdict=replace(report.verdict, reason=reason))


def _report(
    test: ClaimTest,
    assertion: Assertion,
    design: Design,
    verdict: Verdict,
    trials: Fetch,
    again: Mapping[str, Collection[int]],
) -> ClaimReport:
    groups = [source for source in assertion.sources() if isinstance(source, TrialGroup)]
    return replace(
        unjudged(test, verdict.outcome, verdict.reason),
        verdict=verdict,
        asserts=content_hash(assertion.plain()),
        sources=tuple(
            _source(group, trials(group, seeds) if seeds else (), again.get(group.fingerprint, ()), assertion, seeds)
            for group in groups
            for seeds in [design.seeds(verdict.n, bool(group.condition.existing))]
        ),
        attainable=tuple(
            Attainable(look.n, look.alpha, p.supported, p.refuted, p.smaller)
            for look, p in attainability(assertion, design)
        ),
    )


def _source(
    group: TrialGroup,
    trials: Sequence[TrialResult],
    again: Collection[int],
    assertion: Assertion,
    seeds: Sequence[int],
) -> SourceTrials:
    condition = group.condition
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
