"""What has changed where a claim's history begins anew: which settings its accepted verdict's trials were made with."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, Final

from evoclaims.claims.session import Session
from evoclaims.core.canonical import content_hash
from evoclaims.judging.drift import changed_settings
from evoclaims.paper import references
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import DamagedFileError
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import AcceptedVerdict, key_of

MOST: Final = 10_000
"""Most combinations of stored conditions that are tried for one claim."""

NAMES: Final = (("method", "name"), ("task", "name"), ("imported", "file"))
"""Where a specification has the names that an edit seldom changes together."""


def changes(
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
    found = {key_of(report): _change(session, report, old, stored) for report, old in changed}
    return {key: text for key, text in found.items() if text}


def _change(session: Session, report: ClaimReport, old: AcceptedVerdict, stored: Sequence[TrialResult]) -> str:
    """Return what differs for one claim; empty if its accepted verdict's trials are not found."""
    tier = session.reproduction.tier(report.tier, session.variant)
    now = {source.label: tier.condition(source.method, source.task) for source in report.sources}
    folder = session.reproduction.references_of(session.variant)
    own = [references.committed(folder, report.tier, source.method, source.task) for source in report.sources]
    groups = [_conditions([*stored, *trials], set(tier.design.seeds(old.n))) for trials in own]
    for alike in (2, 1):  # names of method and task that stayed: an edit seldom changes both
        sides = [
            [trials for trials in of_source if _alike(trials[0].spec, condition.plain) >= alike]
            for of_source, condition in zip(groups, now.values(), strict=True)
        ]
        for chosen in itertools.product(*sides) if math.prod(map(len, sides)) <= MOST else ():
            digests = {trial.id: trial.digest for trials in chosen for trial in trials}
            if content_hash(sorted(digests.values())) == old.trials:
                return _settings(now, chosen)
    return ""


def _conditions(trials: Sequence[TrialResult], seeds: set[int]) -> list[list[TrialResult]]:
    """Return the trials of these seeds by condition, of those that have all of them."""
    groups: dict[str, dict[int, TrialResult]] = defaultdict(dict)
    for trial in trials:
        if trial.seed in seeds:
            groups[trial.condition][trial.seed] = trial
    return [list(group.values()) for group in groups.values() if len(group) == len(seeds)]


def _alike(old: Mapping[str, Any], new: Mapping[str, Any]) -> int:
    """Return how many names of two conditions are the same: of the method and the task, or of the imported table."""
    names = [[(spec.get(part) or {}).get(name) for part, name in NAMES] for spec in (old, new)]
    return sum(one == other for one, other in zip(*names, strict=True) if one is not None)


def _settings(now: Mapping[str, Condition], before: Sequence[Sequence[TrialResult]]) -> str:
    """Return the settings of each side that differ."""
    changed = {
        label: changed_settings(trials[0].spec, condition.plain)
        for (label, condition), trials in zip(now.items(), before, strict=True)
        if trials[0].condition != condition.id
    }
    return (
        "; ".join(f"of {label}, {text}" for label, text in changed.items())
        or "its trials are of the same conditions, but its assertion, its design or the rules of judging differ"
    )
