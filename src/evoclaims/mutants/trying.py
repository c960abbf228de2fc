"""Trying mutants on claims: the faulty conditions, and which faults each claim notices."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from evoclaims.judging.baseline import ALPHA, DriftCase, check_drift
from evoclaims.mutants.mutant import Mutant
from evoclaims.paper.archive import Archive
from evoclaims.paper.references import METRICS, load, path_of
from evoclaims.paper.reproduction import Reproduction
from evoclaims.paper.variant import Conditions, Variant
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition
from evoclaims.verdicts.acceptance import UNDECIDED
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import key_of
from evoclaims.verdicts.mutation_matrix import Attempt, Matrix, Sensitivity, fate

Names = tuple[str, str]
"""A method and a task, as claims name them."""


@dataclass(frozen=True)
class Planted:
    """A fault in one method, or one task, of a tier.

    Attributes:
        mutant: the fault's name.
        target: the method or task that has it.
        conditions: the faulty ones.
    """

    mutant: str
    target: str
    conditions: Conditions

    @property
    def name(self) -> str:
        """A name such as "cma_es: minimizes"."""
        return f"{self.target}: {self.mutant}"


def plantings(sound: Conditions, mutants: Mapping[str, Mutant]) -> tuple[Planted, ...]:
    """Return every fault in every method or task that it can be planted in."""
    return tuple(
        Planted(name, target, mutant.conditions(sound, target))
        for name, mutant in mutants.items()
        for target in mutant.targets(sound)
    )


def under_faults(reproduction: Reproduction, tier: str, planted: Sequence[Planted]) -> Reproduction:
    """Return the reproduction with the faults as its variants, so that claims are judged under each fault."""
    return replace(reproduction, variants={one.name: Variant(one.name, {tier: one.conditions}) for one in planted})


@dataclass(frozen=True)
class Comparison:
    """Faulty trials against sound ones.

    Attributes:
        archive: holds both.
        reproduction: without faults.
        tier: its name.
        used: the conditions that the tier's claims use: the drift check corrects for all of them.
    """

    archive: Archive
    reproduction: Reproduction
    tier: str
    used: frozenset[Names]

    def equivalent(self, names: Names, faulty: Condition) -> bool:
        """Whether every faulty trial has the results of the sound one of its seed."""
        sound = self._trials(self._sound(names))
        pairs = zip(sound, self._trials(faulty), strict=True)
        return all(a and b and (a.status, a.levels, a.metrics) == (b.status, b.levels, b.metrics) for a, b in pairs)

    def drifted(self, names: Names, faulty: Condition) -> bool:
        """Whether faulty trials drift from the reference trials, at the drift check's strictest correction."""
        reference = load(path_of(self.reproduction.references, self.tier, *names))
        case = DriftCase(
            label=" on ".join(names),
            condition=faulty.id,
            new=tuple(trial for trial in self._trials(faulty) if trial is not None),
            reference=tuple(
                replace(trial, condition=faulty.id) for trial in reference if trial.condition == self._sound(names).id
            ),
            metrics=METRICS,
        )
        return check_drift([case], ALPHA / max(1, len(self.used))).drifted

    def _sound(self, names: Names) -> Condition:
        """Return a condition without a fault."""
        return self.reproduction.tier(self.tier).condition(*names)

    def _trials(self, condition: Condition) -> tuple[TrialResult | None, ...]:
        """Return the trials of the last look."""
        protocol = self.reproduction.tier(self.tier).protocol
        return self.archive.trials(condition, protocol.seeds(protocol.last.n))


def noticed(
    comparison: Comparison,
    sound: Sequence[ClaimReport],
    planted: Sequence[Planted],
    faulty: Sequence[Sequence[ClaimReport]],
) -> Matrix:
    """Return which faults each claim notices, of those that its conditions can have.

    Args:
        comparison: of trials.
        sound: reports of the claims without a fault.
        planted: the faults.
        faulty: reports under each of them.
    """
    reports = {
        (one.name, key_of(report)): report for one, several in zip(planted, faulty, strict=True) for report in several
    }
    trials = {(one.name, names): (names, condition) for one in planted for names, condition in one.conditions.items()}
    equivalent = {key: comparison.equivalent(*both) for key, both in trials.items()}
    drifted = {key: comparison.drifted(*both) for key, both in trials.items()}

    def attempts(report: ClaimReport) -> Iterator[Attempt]:
        asked = {(source.method, source.task) for source in report.sources}
        for one in planted:
            touched = [(one.name, names) for names in one.conditions if names in asked]
            if touched:
                outcome = reports[one.name, key_of(report)].outcome
                became = fate(
                    report.outcome,
                    outcome,
                    equivalent=all(equivalent[key] for key in touched),
                    drifted=any(drifted[key] for key in touched),
                )
                yield Attempt(one.mutant, one.target, outcome, became)

    return {
        key_of(report): Sensitivity(report.outcome, report.fingerprint, tuple(attempts(report)))
        for report in sound
        if report.outcome not in UNDECIDED
    }


def merged(before: Matrix, now: Matrix) -> Matrix:
    """Return a matrix where new attempts replace old ones; others stay while their claim is unchanged."""
    rows = dict(before)
    for key, row in now.items():
        old = before.get(key)
        if old is not None and (old.fingerprint, old.outcome) == (row.fingerprint, row.outcome):
            kept = {attempt.name: attempt for attempt in (*old.attempts, *row.attempts)}
            row = replace(row, attempts=tuple(kept.values()))
        rows[key] = row
    return rows
