"""Trying mutants on claims: which faults each claim notices, judged from trials at hand."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

from evoclaims.core.errors import UserError
from evoclaims.core.packages import recorded
from evoclaims.judging.drift import ALPHA, DriftCase, check_drift
from evoclaims.judging.verdict import Outcome
from evoclaims.mutants.mutant import Planted
from evoclaims.paper.archive import Archive
from evoclaims.paper.references import load, measures, path_of
from evoclaims.paper.reproduction import Names, Reproduction, Variant
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import key_of
from evoclaims.verdicts.mutation_matrix import Attempt, Fate, Matrix, Sensitivity, fate
from evoclaims.verdicts.source_trials import change


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

    def check(self, planted: Sequence[Planted]) -> None:
        """Check that faulty trials were made with the versions of the sound ones: else these may be what differs.

        Raises:
            UserError: when some were not, as where a store comes from elsewhere.
        """
        for one in planted:
            for names, condition in one.conditions.items():
                sound, faulty = (
                    [recorded(trial.provenance, condition.packages) for trial in self._trials(each) if trial]
                    for each in (self._sound(names), condition)
                )
                if other := next((made for made in faulty if sound and made not in sound), None):
                    raise UserError(
                        f"Trials of {' on '.join(names)} with the fault {one.mutant!r} were made with other versions "
                        f"than those without it ({change(sound[0], other)}), so that no difference would show what "
                        "the fault does. Judge such a store where its versions are installed."
                    )

    def equivalent(self, names: Names, faulty: Condition, curves: Collection[str]) -> bool:
        """Whether every faulty trial ends as the sound one of its seed, and has the same of the `curves` that count."""

        def result(trial: TrialResult) -> object:
            read = repr([trial.curves.get(name) for name in curves])  # a NaN is not equal to itself
            return trial.status, trial.levels, trial.metrics, read

        pairs = zip(self._trials(self._sound(names)), self._trials(faulty), strict=True)
        return all(a and b and result(a) == result(b) for a, b in pairs)

    def drifted(self, names: Names, faulty: Condition, reads: Collection[str]) -> bool:
        """Whether faulty trials drift from the reference trials, at the drift check's strictest correction.

        Tested is what claims read of them, too, as in a run of pytest.
        """
        reference = load(path_of(self.reproduction.references, self.tier, *names))
        new = tuple(trial for trial in self._trials(faulty) if trial is not None)
        case = DriftCase(
            label=" on ".join(names),
            condition=faulty.id,
            new=new,
            reference=tuple(
                replace(trial, condition=faulty.id) for trial in reference if trial.condition == self._sound(names).id
            ),
            metrics=measures(new, reads),
        )
        return check_drift([case], ALPHA / max(1, len(self.used))).drifted

    def _sound(self, names: Names) -> Condition:
        return self.reproduction.tier(self.tier).condition(*names)

    def _trials(self, condition: Condition) -> tuple[TrialResult | None, ...]:
        design = self.reproduction.tier(self.tier).design
        return self.archive.trials(condition, design.seeds(design.last.n))


def noticed(
    comparison: Comparison,
    sound: Sequence[ClaimReport],
    planted: Sequence[Planted],
    faulty: Sequence[Sequence[ClaimReport]],
    failed: Collection[tuple[str, Names]],
) -> Matrix:
    """Return which faults each judged claim notices, of those that its conditions can have and that have run.

    Args:
        comparison: of trials.
        sound: reports of the claims without a fault.
        planted: the faults.
        faulty: reports under each of them.
        failed: conditions that have just failed to run, by the name of the fault and their own.
    """
    reports = {
        (one.name, key_of(report)): report for one, several in zip(planted, faulty, strict=True) for report in several
    }

    @cache
    def compared(fault: str, names: Names, curves: tuple[str, ...]) -> tuple[bool, bool]:
        condition = conditions[fault, names]
        return comparison.equivalent(names, condition, curves), comparison.drifted(names, condition, reads[names])

    conditions = {(one.name, names): condition for one in planted for names, condition in one.conditions.items()}
    reads: dict[Names, set[str]] = defaultdict(set)
    for source in (source for report in sound for source in report.sources):
        reads[source.method, source.task].update(source.reads)

    def attempt(report: ClaimReport, one: Planted, touched: Sequence[Names]) -> Attempt | None:
        under = reports[one.name, key_of(report)]
        outcome = under.outcome
        late = report.wants_time or under.wants_time
        if late or any((one.name, names) in failed for names in touched):
            became = Fate.BROKEN
        elif outcome is Outcome.NOT_RUN:
            return None
        else:
            found = (compared(one.name, names, _curves(report, names)) for names in touched)
            equivalent, drifted = zip(*found, strict=True)
            became = fate(report.outcome, outcome, equivalent=all(equivalent), drifted=any(drifted))
        return Attempt(one.mutant, one.part, one.target, outcome if became is Fate.KILLED else report.outcome, became)

    def row(report: ClaimReport) -> Sensitivity:
        tries = {one.name: attempt(report, one, touched) for one in planted if (touched := one.touching(report))}
        return Sensitivity(
            report.outcome,
            report.fingerprint,
            tuple(dict.fromkeys(source.method for source in report.sources)),
            tuple(one for one in tries.values() if one is not None),
        )

    return {key_of(report): row(report) for report in sound if report.outcome.judged}


def _curves(report: ClaimReport, names: Names) -> tuple[str, ...]:
    reads = {read for source in report.sources if (source.method, source.task) == names for read in source.reads}
    return tuple(sorted(read.removeprefix("curves.") for read in reads if read.startswith("curves.")))


def merged(before: Matrix, now: Matrix, tier: str, applicable: Mapping[tuple[str, str], Collection[str]]) -> Matrix:
    """Return a matrix where new attempts replace old ones, and what no longer applies is left out.

    Old attempts stay while their claim is unchanged; without new ones a claim that has changed has no row.

    Args:
        before: all tiers.
        now: new rows of one tier.
        tier: its name.
        applicable: names of all mutants that each claim of the tier can notice, by claim; other claims are left out.
    """
    rows = {key: row for key, row in before.items() if key[0] != tier or key in applicable}
    for key, row in now.items():
        old, attempts = before.get(key), {attempt.name: attempt for attempt in row.attempts}
        if old is not None and (old.fingerprint, old.outcome) != (row.fingerprint, row.outcome):
            rows.pop(key, None)
        elif old is not None:
            attempts = {attempt.name: attempt for attempt in old.attempts} | attempts
        known = {name: attempts[name] for name in applicable[key] if name in attempts}
        if known:
            untried = tuple(name for name in applicable[key] if name not in known)
            rows[key] = replace(row, attempts=tuple(known.values()), untried=untried)
    return rows
