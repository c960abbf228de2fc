"""The trials that claims were judged from, compared with earlier ones: committed, or made with other versions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from evoclaims.claims.fetching import StoredOnly
from evoclaims.claims.session import Session
from evoclaims.core.packages import agree, recorded
from evoclaims.judging.drift_report import DriftReport
from evoclaims.judging.tripwire import DigestCheck
from evoclaims.paper import pilots, references
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.upgrade import Succession, Upgrade, predecessors, upgrade


@dataclass(frozen=True)
class _Used:
    """A condition that a tier's claims use: the ids of its trials, and the seeds that were run again."""

    tier: str
    method: str
    task: str
    condition: Condition
    ids: set[str] = field(default_factory=set)
    again: set[int] = field(default_factory=set)
    reads: set[str] = field(default_factory=set)


def drift(session: Session, reports: Sequence[ClaimReport]) -> tuple[DriftReport, DigestCheck]:
    """Compare the trials behind `reports` with the committed reference trials of their tiers."""
    cases = [
        references.paired(
            f"{used.method} on {used.task} ({used.tier})",
            trials,
            _reference(session, used),
            method=f"{used.method} ({used.tier})",
            reads=used.reads,
            pilot=_pilot(session, used),
        )
        for used in _used(session, reports)
        if (trials := _trials(session, used))
    ]
    return references.compare(cases)


def upgraded(session: Session, reports: Sequence[ClaimReport]) -> Upgrade:
    """Compare the trials behind `reports` with the store's trials of other versions.

    Conditions that are themselves judged from trials of other versions are left out.
    """
    successions = []
    for used in _used(session, reports):
        condition, trials = used.condition, _trials(session, used)
        here = condition.versions
        now = tuple(trial for trial in trials if agree(trial.provenance, here))
        design = session.reproduction.tier(used.tier).design
        seeds = {*design.seeds(design.last.n), *(trial.seed for trial in now)}
        others = (session.store.others(TrialSpec(condition, seed).id, here) for seed in seeds)
        before = predecessors([record for several in others for record in several], condition.packages)
        if now and before and len(now) == len(trials):
            old = recorded(before[0].provenance, condition.packages)
            label = f"{used.method} on {used.task} ({used.tier})"
            method, reads = f"{used.method} ({used.tier})", tuple(sorted(used.reads))
            successions.append(Succession(label, old, here, before, now, len(used.again), method, reads))
    return upgrade(successions)


def _used(session: Session, reports: Sequence[ClaimReport]) -> list[_Used]:
    """Return each condition of `reports` once, with all its judged trials."""
    found: dict[tuple[str, str, str], _Used] = {}
    for report in reports:
        if session.variant and not report.n:  # a variant leaves most claims unchanged
            continue
        for source in report.sources:
            names = report.tier, source.method, source.task
            if names not in found:
                tier = session.reproduction.tier(report.tier, session.variant)
                found[names] = _Used(*names, tier.condition(*names[1:]))
            found[names].ids.update(source.trials)
            found[names].again.update(source.again)
            found[names].reads.update(source.reads)
    return [used for _, used in sorted(found.items())]


def _reference(session: Session, used: _Used) -> tuple[TrialResult, ...]:
    """Return a condition's reference trials: the variant's own, or those of the protocol or another variant."""
    names = used.tier, used.method, used.task
    own = references.committed(session.reproduction.references_of(session.variant), *names)
    if any(trial.condition == used.condition.id for trial in own):
        return own
    return references.of_condition(session.reproduction.references, *names, used.condition.id) or own


def _pilot(session: Session, used: _Used) -> tuple[TrialResult, ...]:
    """Return the committed pilot of a condition; empty without one."""
    found = pilots.load(pilots.path_of(session.reproduction.folder, used.tier, used.method, used.task))
    return found if found and found[0].condition == used.condition.id else ()


def _trials(session: Session, used: _Used) -> list[TrialResult]:
    """Return the stored trials that a condition's claims were judged from."""
    get = session.fetch.archive.stored if isinstance(session.fetch, StoredOnly) else session.store.get
    stored = (get(trial, used.condition.versions) for trial in sorted(used.ids))
    return [trial for trial in stored if trial is not None]
