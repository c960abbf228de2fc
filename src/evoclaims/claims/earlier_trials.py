"""The trials that claims were judged from, compared with earlier ones: committed, accepted, or of other versions."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from evoclaims.claims.fetching import NotStoredError, RunMissing
from evoclaims.claims.session import Session
from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UserError, in_one_line
from evoclaims.core.packages import agree, recorded
from evoclaims.core.provenance import same_bits
from evoclaims.judging.drift import DriftCase, by_one_code, changed_settings, check_drift
from evoclaims.judging.drift_report import DigestCheck, DriftReport, compare_digests
from evoclaims.paper import pilots, references
from evoclaims.paper.archive import Archive
from evoclaims.trials.failed import is_final
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import DamagedFileError
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import AcceptedVerdict, key_of
from evoclaims.verdicts.upgrade import Succession, Upgrade, predecessors, upgrade

MOST: Final = 10_000
"""Most combinations of stored conditions that are tried for one claim."""

TIMES: Final = 3
"""How many times as many trials repeat a drift as have shown it: they hardly ever miss a true one."""

ALPHA_REPEATED: Final = 0.05
"""Of the repetition. Both tests have the same earlier trials; how often chance passes both is in docs/judging.md."""

NAMES: Final = (("method", "name"), ("task", "name"), ("imported", "file"), ("imported", "where"))
"""Where a specification has what an edit seldom changes together: names, or which rows of a table are read."""


@dataclass(frozen=True)
class _Used:
    """A condition that a tier's claims use: the ids of its trials, and the seeds that were run again.

    `for_drift` are ids of trials that no claim reads. They count if all are there, ended and of the versions of the
    others: those that end first are no sample.
    """

    tier: str
    method: str
    task: str
    condition: Condition
    for_drift: frozenset[str]
    ids: set[str] = field(default_factory=set)
    again: set[int] = field(default_factory=set)
    reads: set[str] = field(default_factory=set)

    @property
    def label(self) -> str:
        return f"{self.method} on {self.task} ({self.tier})"

    @property
    def family(self) -> str:
        """What is tested for drift together: all conditions of a method."""
        return f"{self.method} ({self.tier})"


def drift(session: Session, reports: Sequence[ClaimReport]) -> tuple[DriftReport, DigestCheck]:
    """Compare the trials behind `reports` with the committed reference trials of their tiers."""
    cases = [_case(session, used, trials) for used in _used(session, reports) if (trials := _trials(session, used))]
    return references.compare(cases)


def repeated(
    session: Session, reports: Sequence[ClaimReport], found: DriftReport, say: Callable[[str], None]
) -> DriftReport:
    """Test methods that drifted once more, with trials of fresh seeds, at tiers that ask for it (`repeat_drift`).

    Of a hundred runs in which nothing changed, one drifts; on a machine of the same kind, each later run then makes
    the same trials and drifts, too. A drift that the fresh trials do not show is "not repeated" and fails no run. It
    stands where they cannot be made as the run's own trials were, or cannot be compared. `say` receives a sentence
    before they run.
    """
    drifted = {row.label for row in found.rows if row.drifted}
    tested = {row.label for row in found.rows if row.p is not None}
    every = [used for used in _used(session, reports) if used.label in tested]
    asking = {name for name, tier in session.reproduction.tiers.items() if tier.repeat_drift}
    for family in sorted({used.family for used in every if used.label in drifted and used.tier in asking}):
        mine = [used for used in every if used.family == family]
        try:
            _check_makes_alike(session, mine)
            if not session.only_reads:
                say(f"{family} has drifted; {TIMES} times as many trials, with fresh seeds, tell this from chance")
            fresh = [_fresh(session, used) for used in mine]
        except Exception as error:  # what a method raises, say: the verdicts are there, and must not be lost by it
            known = isinstance(error, UserError | NotStoredError)
            why = str(error) if known else in_one_line(error, session.reproduction.folder)
            found = found.standing(f"there are no trials of {family} with fresh seeds: {why}")
            continue
        cases = [_case(session, used, trials) for used, trials in zip(mine, fresh, strict=True)]
        found = found.repeated_by(check_drift(cases, ALPHA_REPEATED), family, {used.label for used in mine})
    return found


def _case(session: Session, used: _Used, trials: Sequence[TrialResult]) -> DriftCase:
    """Return some trials of a condition beside its reference trials and pilots."""
    reference, new = _reference(session, used), {trial.id for trial in trials}
    pilot = [trial for trial in _pilot(session, used) if trial.id not in new]
    return references.paired(used.label, trials, reference, method=used.family, reads=used.reads, pilot=pilot)


def _check_makes_alike(session: Session, several: Sequence[_Used]) -> None:
    """Refuse conditions whose fresh trials would be imported, or not made as their others were.

    Without a change, trials have the bits of the reference trials wherever these were made on such a machine. Where
    they do not, chance is no explanation: an edited package, say, has made them.

    Raises:
        UserError: which says why.
    """
    for used in several:
        if used.condition.existing:
            raise UserError(f"those of {used.label} are imported")
        trials = _trials(session, used)
        if compare_digests(list(filter(is_final, trials)), _reference(session, used)).changed:
            raise UserError(
                f"those of {used.label} have other bits than reference trials of the same seeds, machine and versions, "
                "and that is no chance"
            )
        made = [trial.provenance for trial in trials]
        if any(one.get("device", {}).get("platform") != "cpu" for one in made):
            raise UserError(f"they run on CPUs, and those of {used.label} did not")
        if any((one.get("git") or {}).get("dirty") for one in made):  # edited again, it would look the same
            raise UserError(f"those of {used.label} were made by code that was not committed, and may differ now")
    if isinstance(session.fetch, RunMissing) and not session.fetch.has_time_for_drift:
        raise UserError("they run on CPUs, and not under a time limit below an hour")


def _fresh(session: Session, used: _Used) -> Sequence[TrialResult]:
    """Return trials of a condition with seeds that none of its others has, made as the judged ones were.

    It is one that may have such trials (see `_check_makes_alike`).

    Raises:
        UserError: when they cannot be made so.
        NotStoredError: when they may not be run.
    """
    condition, trials, fetch = used.condition, _trials(session, used), session.fetch
    first = 1 + max(trial.seed for trial in (*trials, *_reference(session, used), *_pilot(session, used)))
    fresh = fetch(condition, range(first, first + TIMES * len(trials)))
    alike = (
        by_one_code(one, other) and same_bits(one.provenance, other.provenance) for one in fresh for other in trials
    )
    if not all(alike):
        raise UserError(f"those of {used.label} were made on another machine, with other versions, or by other code")
    return fresh


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
        seeds = {*design.seeds(design.last.n, bool(condition.existing)), *(trial.seed for trial in now)}
        others = (session.store.others(TrialSpec(condition, seed).id, here) for seed in seeds)
        before = predecessors([record for several in others for record in several], condition.packages)
        if now and before and len(now) == len(trials):
            old = recorded(before[0].provenance, condition.packages)
            reads = tuple(sorted(used.reads))
            successions.append(Succession(used.label, old, here, before, now, len(used.again), used.family, reads))
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
                condition, more = tier.condition(*names[1:]), tier.seeds_for_drift(*names[1:])
                found[names] = _Used(*names, condition, frozenset(TrialSpec(condition, seed).id for seed in more))
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
    """Return the committed pilots of a condition."""
    return pilots.both(session.reproduction.folder, used.tier, used.method, used.task, used.condition.id)


def _trials(session: Session, used: _Used) -> list[TrialResult]:
    """Return the stored trials that a condition's claims were judged from, and those for the drift check alone."""
    place = session.judged_from
    get = place.stored if isinstance(place, Archive) else place.get

    def stored(trials: Collection[str]) -> list[TrialResult]:
        found = (get(trial, used.condition.versions) for trial in sorted(trials))
        return [trial for trial in found if trial is not None]

    own, more, packages = stored(used.ids), used.for_drift - used.ids, used.condition.packages
    versions = [recorded(trial.provenance, packages) for trial in own]
    alike = [
        trial
        for trial in stored(more)  # a run that does not make them may find those of other versions
        if trial.status != "timeout" and recorded(trial.provenance, packages) in versions
    ]
    return [*own, *alike] if own and len(alike) == len(more) else own


def new_histories(
    session: Session, reports: Sequence[ClaimReport], accepted: Mapping[tuple[str, str], AcceptedVerdict]
) -> dict[tuple[str, str], str]:
    """Return for claims judged by other rules than in their accepted verdicts what differs, as far as it is known.

    An accepted verdict has a hash of the digests of its trials, so these are recognized among the store's and the
    committed ones. Claims whose old trials are not at hand are left out.

    Args:
        session: with the store and the reproduction.
        reports: of the current verdicts.
        accepted: the last accepted verdicts, by tier and claim.
    """
    changed = [
        (report, accepted[key_of(report)])
        for report in reports
        if key_of(report) in accepted and report.sources
        if report.fingerprint and report.fingerprint != accepted[key_of(report)].fingerprint
    ]
    if not changed:
        return {}
    errors: list[DamagedFileError] = []
    stored = list(session.store.results(errors))
    found = {key_of(report): _new_history(session, report, old, stored) for report, old in changed}
    return {key: text for key, text in found.items() if text}


def _new_history(session: Session, report: ClaimReport, old: AcceptedVerdict, stored: Sequence[TrialResult]) -> str:
    """Return what differs for one claim; empty if its accepted verdict's trials are not found."""
    tier = session.reproduction.tier(report.tier, session.variant)
    now = {source.label: tier.condition(source.method, source.task) for source in report.sources}
    folder = session.reproduction.references_of(session.variant)
    own = [references.committed(folder, report.tier, source.method, source.task) for source in report.sources]
    groups = [
        _by_condition([*stored, *trials], set(tier.design.seeds(old.n, bool(condition.existing))))
        for trials, condition in zip(own, now.values(), strict=True)
    ]
    for alike in (2, 1):  # names that stayed: an edit seldom changes both
        sides = [
            [trials for trials in of_source if _alike(trials[0].spec, condition.plain) >= alike]
            for of_source, condition in zip(groups, now.values(), strict=True)
        ]
        found = []
        for chosen in itertools.product(*sides) if math.prod(map(len, sides)) <= MOST else ():
            digests = {trial.id: trial.digest for trials in chosen for trial in trials}
            if content_hash(sorted(digests.values())) == old.trials:
                found.append(_settings(now, chosen))
        if found:  # the same trials may also stand for each other's conditions, which would differ in more settings
            return _in_words(min(found, key=lambda changed: sum(map(len, changed.values()))))
    return ""


def _by_condition(trials: Sequence[TrialResult], seeds: set[int]) -> list[list[TrialResult]]:
    """Return the trials of these seeds by condition, of those that have all of them."""
    groups: dict[str, dict[int, TrialResult]] = defaultdict(dict)
    for trial in trials:
        if trial.seed in seeds:
            groups[trial.condition][trial.seed] = trial
    return [list(group.values()) for group in groups.values() if len(group) == len(seeds)]


def _alike(old: Mapping[str, Any], new: Mapping[str, Any]) -> int:
    """Return how many of `NAMES` two conditions have in common: of method and task, or of an imported table."""
    names = [[(spec.get(part) or {}).get(name) for part, name in NAMES] for spec in (old, new)]
    return sum(one == other for one, other in zip(*names, strict=True) if one is not None)


def _settings(now: Mapping[str, Condition], before: Sequence[Sequence[TrialResult]]) -> dict[str, str]:
    """Return what differs in the settings of each condition that is another one now, by label."""
    return {
        label: changed_settings(trials[0].spec, condition.plain)
        for (label, condition), trials in zip(now.items(), before, strict=True)
        if trials[0].condition != condition.id
    }


def _in_words(changed: Mapping[str, str]) -> str:
    return (
        "; ".join(f"of {label}, {text}" for label, text in changed.items())
        or "its trials are of the same conditions, but its assertion, its design or the rules of judging differ"
    )
