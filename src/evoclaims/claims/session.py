"""A session over a project's claims: its reproduction, its store, and the judging of one claim after another."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from evoclaims.claims.as_published import AsPublished
from evoclaims.claims.claim import Expectation
from evoclaims.claims.collected import ClaimTest
from evoclaims.claims.fetching import NotStoredError, RunMissing, StoredOnly
from evoclaims.claims.null_agents import satisfied_by
from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UserError
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.design import Design, Look
from evoclaims.judging.judge import attainability, decide, fingerprint, judge
from evoclaims.judging.measure import Event, Measure, Profile
from evoclaims.judging.power import Draws
from evoclaims.judging.verdict import Outcome, Verdict
from evoclaims.paper import pilots
from evoclaims.paper.archive import Archive
from evoclaims.paper.pilots import read_of
from evoclaims.paper.reproduction import Reproduction
from evoclaims.paper.trial_group import Fetch, TrialGroup
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import TrialSpec
from evoclaims.trials.store import Store
from evoclaims.verdicts import history, mutation_matrix
from evoclaims.verdicts.claim_report import (
    CONTROL,
    MECHANISM,
    Attainable,
    ClaimReport,
    located,
    named,
    save,
    succeeding,
)
from evoclaims.verdicts.history import following, key_of
from evoclaims.verdicts.mutation_matrix import Matrix
from evoclaims.verdicts.readings import ReadAs, moment
from evoclaims.verdicts.source_trials import SourceTrials, found_in


@dataclass(frozen=True)
class Reading:
    """A reading of a claim's sentence, not yet judged; `ReadAs` has its parts after that."""

    name: str
    assertion: Assertion
    because: str
    since: str


@dataclass(frozen=True)
class Session:
    """What claims are judged with.

    Attributes:
        reproduction: the paper under test.
        store: where trials are kept.
        fetch: runs trials, or reads them.
        trials: a fixed number of trials in place of the tier's looks; None keeps the tier's design.
        variant: name of a variant of the protocol; empty for the protocol itself.
        again: seeds that were run again, since stored trials were made with other versions, by the condition's id.
        runs: the newest report of each claim, by tier and name: a plugin may run its test again.
    """

    reproduction: Reproduction
    store: Store
    fetch: Fetch
    trials: int | None = None
    variant: str = ""
    again: Mapping[str, Collection[int]] = field(default_factory=dict)
    runs: dict[tuple[str, str], ClaimReport] = field(default_factory=dict, compare=False)

    @cached_property
    def mutants(self) -> Matrix:
        """The committed matrix of mutants.

        Raises:
            UserError: when the file holds no matrix.
        """
        return mutation_matrix.load(self.reproduction.folder / mutation_matrix.FILE)

    @cached_property
    def accepted(self) -> history.History:
        """The verdicts as they were accepted before this session.

        Raises:
            UserError: when the file is damaged.
        """
        return history.load(self.reproduction.folder / history.FILE)

    @property
    def judged_from(self) -> Archive | Store:
        """Where `get` returns the record of a trial that was judged, if it has several."""
        return self.fetch.archive if isinstance(self.fetch, StoredOnly) else self.store

    def group(self, method: str, on: str, tier: str) -> TrialGroup:
        """Return the trials of a method on a task, not yet run."""
        condition = self.reproduction.tier(tier, self.variant).condition(method, on)
        return self.reproduction.trials(method, on, condition, self.fetch)

    def design(self, tier: str, *, third_look: bool = False) -> Design:
        """Return a tier's design; with a fixed number of trials, it has one look with the whole α.

        Variants have no third look: their trials are ten, and a verdict that these leave open would count as not run.
        """
        design = self.reproduction.tier(tier).design
        if self.trials is None:
            return design.with_third_look() if third_look and not self.variant else design
        return replace(design, looks=(Look(self.trials, design.alpha),))

    def settle(self, test: ClaimTest, assertion: Assertion, others: Sequence[Reading] = ()) -> ClaimReport:
        """Judge an assertion; trials that may not be run make the verdict "not run".

        A session that only reads trials judges `others`, too, the further readings of the sentence.
        """
        design, claim = self.design(test.tier, third_look=test.third_look), test.claim
        verdict = self._verdict(test, assertion, design)
        report = judged(test, assertion, design, verdict, self.again)
        by, chance = self._satisfied_by(test, assertion, design, verdict), self._chance(report, assertion, design)
        report = replace(report, satisfied_by=by, chance=chance)
        if self.variant or not isinstance(self.fetch, StoredOnly) or not claim.is_read_at(test.tier):
            return report
        first = Reading(claim.read, assertion, "the assertion that the claim judges", claim.since)
        read = (_judged(first, design, verdict.outcome), *(_judged(one, design) for one in others))
        return replace(report, readings=read)

    def _verdict(self, test: ClaimTest, assertion: Assertion, design: Design) -> Verdict:
        """Return the verdict on an assertion; "not run" where trials may not be run."""
        name, tier = named(test.claim.id, test.case), test.tier
        try:
            if self.leaves(tier, assertion):
                raise NotStoredError(f"the variant {self.variant} changes none of its trials")
            verdict = judge(assertion, design, claim=name, tier=tier)
            shown = self._crash_shown_by(assertion, tier, verdict)
            return replace(verdict, reason=f"{verdict.reason}; {shown} shows its last output") if shown else verdict
        except NotStoredError as error:
            mark = fingerprint(assertion, design, claim=name, tier=tier)
            of = next((f"{one.label}: " for one in assertion.sources() if one.fingerprint == error.condition), "")
            return Verdict(Outcome.NOT_RUN, f"{of}{error}", assertion.describe(), mark)

    def _satisfied_by(self, test: ClaimTest, assertion: Assertion, design: Design, verdict: Verdict) -> tuple[str, ...]:
        """Return the null agents that satisfy a claim of the paper; controls and mechanisms are left out.

        Only trials that were looked at are asked for again, so that nothing runs for it.
        """
        agents = self.reproduction.null_agents
        if (
            not agents
            or not verdict.n
            or test.claim.where in (CONTROL, MECHANISM)
            or isinstance(self.fetch, AsPublished)
        ):
            return ()
        look, reads = Look(verdict.n, design.alpha), isinstance(self.fetch, StoredOnly)
        if reads and assertion.attainable(look.n, design).supported > look.alpha:
            look = Look(design.last.n, design.alpha)

        def others(method: str, task: str) -> TrialGroup:
            return self.group(method, task, test.tier)

        return satisfied_by(agents, assertion, look, design, others if reads else None)

    def _chance(self, report: ClaimReport, assertion: Assertion, design: Design) -> float | None:
        """Return how often an inconclusive claim ends so in draws from its pilots, if it was accepted as supported."""
        if report.outcome is not Outcome.INCONCLUSIVE or self.variant or self.trials is not None:
            return None
        found: dict[str, tuple[TrialResult, ...]] = {}
        try:
            accepted = self.accepted.get(history.key_of(report), ())
            if not accepted or accepted[-1].outcome is not Outcome.SUPPORTED:
                return None
            for group in assertion.sources():
                if not isinstance(group, TrialGroup):
                    return None
                path = pilots.path_of(self.reproduction.folder, report.tier, group.method, group.task)
                readings = [one for one in assertion.readings() if one.source.fingerprint == group.fingerprint]
                found[group.fingerprint] = pilots.load(path)
                if pilots.unfit(found[group.fingerprint], group.condition, design, readings):
                    return None
        except UserError:  # whoever compares with the damaged file says so
            return None
        outcomes = list(Draws(found).outcomes(assertion, design))
        return outcomes.count(Outcome.INCONCLUSIVE) / len(outcomes)

    def _crash_shown_by(self, assertion: Assertion, tier: str, verdict: Verdict) -> str:
        """Return the command that runs a verdict's crashed trials alone; empty where none crashed."""
        if verdict.outcome is not Outcome.ERROR or self.variant:
            return ""
        groups = [source for source in assertion.sources() if isinstance(source, TrialGroup)]
        names = [(one.method, one.task) for one in groups if f"trials of {one.label} crashed" in verdict.reason]
        return f"`evoclaims run {names[0][0]} --on {names[0][1]} --tier {tier}`" if names else ""

    def complete(self, report: ClaimReport, expectation: Expectation | None) -> ClaimReport:
        """Return a report with the variant, an accepted outcome, what mutants showed, and the file that holds it.

        A session that runs trials saves the report; one that only reads them refers to an earlier run's file. What the
        paper's own numbers give is neither expected nor kept.
        """
        if isinstance(self.fetch, AsPublished):
            return report
        complete, root = expecting(replace(report, variant=self.variant), expectation), self.store.root
        if not self.variant:  # mutants are tried on the protocol itself
            complete = replace(complete, tried=mutation_matrix.tried(self.mutants, complete))
        last, reads = self.runs.get(key_of(complete)), isinstance(self.fetch, StoredOnly)
        if last is not None:
            complete = following(complete, last)
        elif not reads:
            complete = succeeding(complete, root)
        complete = located(complete, root) if reads else save(complete, root)
        self.runs[key_of(complete)] = complete
        return complete

    def save(self, report: ClaimReport) -> ClaimReport:
        """Write a report's file again, with runs of other processes; only a session that runs trials does."""
        return save(report, self.store.root) if report.evidence and isinstance(self.fetch, RunMissing) else report

    def leaves(self, tier: str, assertion: Assertion) -> bool:
        """Whether there is a variant, and the protocol itself has all conditions that an assertion is about."""
        if not self.variant:
            return False
        plain = self.reproduction.tier(tier)
        groups = [source for source in assertion.sources() if isinstance(source, TrialGroup)]
        return all(plain.condition(group.method, group.task).id == group.fingerprint for group in groups)


def _judged(reading: Reading, design: Design, outcome: Outcome | None = None) -> ReadAs:
    """Judge a reading by the trials at hand; its outcome is given if it has been judged already."""
    started: list[str] = []
    try:
        ending = decide(reading.assertion, design)
        if ending is not None:
            trials = [trial for several in ending.trials.values() for trial in several]
            started = [str(trial.timing["started"]) for trial in trials if "started" in trial.timing]
        found = Outcome.INCONCLUSIVE if ending is None else ending.outcome
    except NotStoredError:
        found = Outcome.NOT_RUN
    asserts, since = reading.assertion.describe(), min(started, default="")
    return ReadAs(reading.name, reading.because, reading.since, asserts, outcome or found, since)


@dataclass
class VerdictFixture:
    """The `verdict` fixture: takes exactly one assertion per test, settles it, and keeps its report."""

    settle: Callable[[Assertion, Sequence[Reading]], object]
    report: Any = None
    readings: list[Reading] = field(default_factory=list)

    def __call__(self, assertion: Assertion) -> None:
        """Judge the claim's assertion.

        Raises:
            UserError: for a second assertion, or a value that is not one.
        """
        if not isinstance(assertion, Assertion):
            alone = isinstance(assertion, Measure | Event | Profile)
            if callable(assertion):
                name = getattr(assertion, "__name__", type(assertion).__name__)
                raise UserError(f"verdict(...) was given the function {name} itself: call it, as in {name}().")
            raise UserError(
                f"verdict(...) takes an assertion about trials, such as verdict(a.mean_success > b.mean_success), "
                f"not {f'{assertion.name!r} alone: compare it with something' if alone else repr(assertion)}."
            )
        if self.report is not None:
            raise UserError("A claim has one verdict: join several assertions with & (and) or | (or).")
        self.report = self.settle(assertion, self.readings)

    def reading(self, name: str, assertion: Assertion, *, because: str, since: str) -> None:
        """Add another reading of the claim's sentence, before `verdict(...)`: the verdict shows whether it depends.

        It counts where the paper's own sentence is judged, not at a tier with a smaller statement.

        Args:
            name: a few words.
            assertion: what the sentence says if it is read so.
            because: why it may be read so.
            since: when the reading was written, such as "2026-11-26" or "2026-11-26 14:30" (UTC).

        Raises:
            UserError: after the verdict, for a name that is taken, a missing text, or something else than a date or an
                assertion.
        """
        if self.report is not None:
            raise UserError(f"The reading {name!r} comes after the verdict: write verdict.reading(...) before it.")
        if not isinstance(assertion, Assertion):
            raise UserError(
                f"The reading {name!r} is {assertion!r}, which is not an assertion. Write one, as for verdict(...)."
            )
        if not (name.strip() and because.strip()) or name in (one.name for one in self.readings):
            raise UserError(f"The reading {name!r} needs a unique name and because=...: why the sentence means this.")
        moment(since)
        self.readings.append(Reading(name, assertion, because, since))


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
