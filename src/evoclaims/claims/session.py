"""A session over a project's claims: its reproduction, its store, where trials come from, and the protocol."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import pytest

from evoclaims.claims.as_published import AsPublished
from evoclaims.claims.claim import ClaimTest, Expectation
from evoclaims.claims.fetching import RunMissing, StoredOnly
from evoclaims.claims.null_agents import answers
from evoclaims.claims.report_making import (
    Reading,
    chance_of_inconclusive,
    crash_shown_by,
    expecting,
    read_as,
    report_of,
    without_trials,
)
from evoclaims.core.errors import UserError, require_known
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.design import Design, Look
from evoclaims.judging.judge import fetch_from
from evoclaims.judging.sample import Source
from evoclaims.judging.verdict import Outcome
from evoclaims.paper.archive import Archive
from evoclaims.paper.reproduction import Reproduction
from evoclaims.paper.trial_group import Fetch, TrialGroup
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import Store
from evoclaims.verdicts import history, mutation_matrix
from evoclaims.verdicts.claim_report import ClaimReport, located, save
from evoclaims.verdicts.mutation_matrix import Matrix


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
    """

    reproduction: Reproduction
    store: Store
    fetch: Fetch
    trials: int | None = None
    variant: str = ""
    again: Mapping[str, Collection[int]] = field(default_factory=dict)

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
        if isinstance(self.fetch, StoredOnly):
            return self.fetch.archive
        # Of any versions, one that came to its end comes before one of these versions that did not.
        any_version = isinstance(self.fetch, RunMissing) and self.fetch.any_version
        return Archive(self.store) if any_version else self.store

    @property
    def only_reads(self) -> bool:
        """Whether it only reads trials."""
        return isinstance(self.fetch, StoredOnly)

    def group(self, method: str, on: str, tier: str) -> TrialGroup:
        """Return the trials of a method on a task, not yet run."""
        condition = self.reproduction.tier(tier, self.variant).condition(method, on)
        return self.reproduction.trials(method, on, condition, self.fetch)

    def trials_of(self, source: Source, seeds: tuple[int, ...]) -> tuple[TrialResult, ...]:
        """Return the trials of a source from this session, whichever session has made the source."""
        return fetch_from(replace(source, get=self.fetch) if isinstance(source, TrialGroup) else source, seeds)

    def design(self, tier: str, third_look: Collection[str] = ()) -> Design:
        """Return a tier's design; with a fixed number of trials, it has one look with the whole α.

        Args:
            tier: "smoke" or "full".
            third_look: the variants under which the claim has one (see `ClaimTest`).

        Raises:
            UnknownNameError: when there is no such variant.
        """
        for name in filter(None, third_look):
            require_known("variant with a third look", name, self.reproduction.variants)
        design = self.reproduction.tier(tier).design
        if self.trials is None:
            return design.with_third_look() if self.variant in third_look else design
        return replace(design, looks=(Look(self.trials, design.alpha),))

    def settle(self, test: ClaimTest, assertion: Assertion, others: Sequence[Reading] = ()) -> ClaimReport:
        """Judge an assertion; trials that may not be run make the verdict "not run".

        A session that only reads trials judges `others`, too, the further readings of the sentence.
        """
        design, claim = self.design(test.tier, test.third_look), test.claim
        if self.leaves(test.tier, assertion):
            return without_trials(test, assertion, design, f"the variant {self.variant} changes none of its trials")
        report = report_of(test, assertion, design, self.trials_of, self.again)
        report = self._with_null_agents(report, assertion, design)
        if self.variant:
            return report
        report = replace(crash_shown_by(report, assertion), chance=self._chance(report, assertion, design))
        if not self.only_reads or not claim.is_read_at(test.tier):
            return report
        first = Reading(claim.read, assertion, "the assertion that the claim judges", claim.since)
        own = read_as(first, design, self.trials_of, report.outcome)
        return replace(report, readings=(own, *(read_as(one, design, self.trials_of) for one in others)))

    def _with_null_agents(self, report: ClaimReport, assertion: Assertion, design: Design) -> ClaimReport:
        """Add the null agents that satisfy a claim of the paper; controls and mechanisms are put to none.

        Only trials that were looked at are asked for again, so that nothing runs for it. Of a variant's verdicts
        tables tell which are vacuous, and nothing else: so only supported ones are put to agents.
        """
        agents = self.reproduction.null_agents
        if not agents or not report.n or report.is_control or isinstance(self.fetch, AsPublished):
            return report
        if self.variant and report.outcome is not Outcome.SUPPORTED:
            return report
        look = Look(report.n, design.alpha)
        if self.only_reads and assertion.attainable(look.n, design).supported > look.alpha:
            look = Look(design.last.n, design.alpha)

        def others(method: str, task: str) -> TrialGroup:
            return self.group(method, task, report.tier)

        found = answers(agents, assertion, look, design, self.trials_of, others if self.only_reads else None)
        return replace(
            report,
            satisfied_by=tuple(name for name, answer in found.items() if answer is True),
            unasked=tuple((name, answer) for name, answer in found.items() if isinstance(answer, str)),
        )

    def _chance(self, report: ClaimReport, assertion: Assertion, design: Design) -> float | None:
        """Return how often an inconclusive claim ends so in draws from its pilots, if it was accepted as supported."""
        if report.outcome is not Outcome.INCONCLUSIVE or self.trials is not None:
            return None
        try:
            accepted = self.accepted.get(history.key_of(report), ())
            if not accepted or accepted[-1].outcome is not Outcome.SUPPORTED:
                return None
            return chance_of_inconclusive(assertion, design, self.reproduction, report.tier)
        except UserError:  # whoever compares with the damaged file says so
            return None

    def complete(
        self, report: ClaimReport, expectation: Expectation | None, last: ClaimReport | None = None
    ) -> ClaimReport:
        """Return a report with the variant, an accepted outcome, what mutants showed, and the file that holds it.

        A session that runs trials saves the report; one that only reads them refers to an earlier run's file. What the
        paper's own numbers give is neither expected nor kept.

        Args:
            report: of a claim.
            expectation: the accepted outcome.
            last: the report of the claim's run before, if a plugin runs its test several times.
        """
        if isinstance(self.fetch, AsPublished):
            return report
        complete, root = expecting(replace(report, variant=self.variant), expectation), self.store.root
        if not self.variant:  # mutants are tried on the protocol itself
            complete = replace(complete, tried=mutation_matrix.tried(self.mutants, complete))
        if last is not None:
            complete = history.following(complete, last)
        return located(complete, root) if self.only_reads else save(complete, root)

    def skipped(self, report: ClaimReport) -> ClaimReport:
        """Return the report of a claim whose test is skipped or missing: as it is, since nothing is kept of it."""
        return report

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


SESSION: pytest.StashKey[Session] = pytest.StashKey()
"""Where a run of pytest keeps its session."""

WITHIN: pytest.StashKey[bool] = pytest.StashKey()
"""Whether a run of pytest is a part of a command, whose process goes on after it."""
