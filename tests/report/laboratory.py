"""A small paper whose trials are made by hand, and its claims judged by the real judge and gathered into a report."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from made_trials import trial_of

from evoclaims.claims.claim import Claim, ClaimTest
from evoclaims.claims.fetching import StoredOnly
from evoclaims.claims.report_making import unjudged
from evoclaims.claims.session import Session
from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.design import Design
from evoclaims.judging.verdict import Outcome
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.methods.neat.evolution import Neat
from evoclaims.methods.neat.settings import Settings, Species
from evoclaims.paper.archive import Archive
from evoclaims.paper.reproduction import Reproduction, Tier
from evoclaims.report.build import gather
from evoclaims.report.model import Page, Section
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import History
from evoclaims.verdicts.mutation_matrix import Matrix

SMALL = Settings(population=16, nodes=12, connections=24, activations=("tanh",), species=Species(most=4))
METHODS: dict[str, Any] = {"better": HandBuilt(), "worse": HandBuilt(negated=True), "neat": Neat(SMALL)}
CONDITIONS = {
    (name, "small"): Condition(method, NParity(3), "curriculum", Budget(generations=2))
    for name, method in METHODS.items()
}
HERE = {
    "device": {"platform": "cpu", "kind": "cpu", "count": 2},
    "git": {"sha": "a" * 40, "dirty": False},
    "machine": "Linux x86_64",
    "versions": {"python": "3.11.7", "jax": "0.10.2", "qdax": None},
}

Judge = Callable[[Callable[[str], Any]], Assertion]


def record(condition: Condition, seed: int, value: float, **changes: Any) -> TrialResult:
    """Return a record of five reports, made here."""
    points = 5
    finite = value if math.isfinite(value) else 0.0
    curves = {
        "environment_steps": tuple(10.0 * (i + 1) for i in range(points)),
        "success": tuple(finite * i / points for i in range(points)),
        "level": (0.0,) * points,
    }
    return trial_of(condition, seed, value, **{"curves": curves, "provenance": HERE, **changes})


@dataclass(frozen=True)
class Laboratory:
    """One store and the claims about it."""

    folder: Path
    design: Design = field(default_factory=lambda: Design.fixed(6))

    @property
    def store(self) -> Store:
        return Store(self.folder / "store")

    @cached_property
    def reproduction(self) -> Reproduction:
        tiers = {"smoke": Tier(CONDITIONS, self.design), "full": Tier(CONDITIONS, self.design)}
        return Reproduction("tiny", "A Tiny Paper", self.folder / "reproduction", tiers)

    @property
    def archive(self) -> Archive:
        return Archive(self.store, self.reproduction.references)

    def put(self, method: str, values: Iterable[float], **changes: Any) -> list[TrialResult]:
        """Store a trial for each value, with the seeds 0, 1, …"""
        made = [record(CONDITIONS[method, "small"], seed, value, **changes) for seed, value in enumerate(values)]
        for trial in made:
            self.store.put(trial, {})
        return made

    def judge(self, assert_: Judge, tier: str = "full", case: str = "", **texts: str) -> ClaimReport:
        """Judge a claim from the store, as `evoclaims report` does."""
        claim = Claim(**{"id": "T1", "says": "Better is better", "where": "§1.2, Fig. 3", "smoke": "In small", **texts})
        test = ClaimTest(claim, tier, case)
        session = Session(self.reproduction, self.store, StoredOnly(self.archive))
        try:
            return session.settle(test, assert_(lambda method: session.group(method, "small", tier)))
        except Exception as error:  # as the pytest plugin does
            return unjudged(test, Outcome.ERROR, str(error))

    def page(
        self,
        *reports: ClaimReport,
        history: History | None = None,
        mutants: Matrix | None = None,
        sentences: dict[str, str] | None = None,
        **more: Any,
    ) -> Page:
        """Gather reports by their tiers; `more` are further parts of the page."""
        verdicts = {tier: [r for r in reports if r.tier == tier] for tier in ("full", "smoke")}
        page = gather(
            self.reproduction,
            {tier: found for tier, found in verdicts.items() if found},
            self.archive,
            history or {},
            sentences=sentences or {},
            mutants=mutants,
        )
        return replace(page, generated="Written by a test.", **more)

    def section(self, report: ClaimReport, **arguments: Any) -> Section:
        """Return the section of one claim."""
        return self.page(report, **arguments).sections[0]


def better_wins(group: Callable[[str], Any]) -> Assertion:
    """Claim that one method is above the other."""
    above: Assertion = group("better").mean_success > group("worse").mean_success
    return above


def better_solves(group: Callable[[str], Any]) -> Assertion:
    """Claim that a method solves the task."""
    solved: Assertion = group("better").solves_every_level.in_most_trials()
    return solved
