"""Accepted verdicts: which differ from the last accepted ones, the entries that record them, and a claim's by date."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from evoclaims.core.canonical import content_hash
from evoclaims.core.printable import printable
from evoclaims.paper.archive import Archive
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import Store
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import AcceptedVerdict, History, key_of


@dataclass(frozen=True)
class Acceptance:
    """The result of accepting the current verdicts.

    Attributes:
        history: with the new entries.
        accepted: a line for each new entry.
        retired: a line for each claim whose entries are left out, since it no longer has a test at their tier.
        left: a line for each claim whose current verdict is not accepted.
    """

    history: History
    accepted: tuple[str, ...]
    retired: tuple[str, ...]
    left: tuple[str, ...]


def accept(history: History, reports: Sequence[ClaimReport], archive: Archive, today: str) -> Acceptance:
    """Append an entry for every claim whose outcome, fingerprint, versions or device is not the last one's.

    An entry is also appended if other trials have changed the printed reason, such as its p.

    A claim without a test at its tier has no verdicts there: those accepted earlier were about another sentence.

    Args:
        history: verdicts accepted so far.
        reports: current verdicts.
        archive: where their trials are.
        today: ISO 8601 date.
    """
    grown, accepted, retired, left = dict(history), [], [], []
    for report in reports:
        key = key_of(report)
        name = f"{key[1]} ({key[0]})"
        past = history.get(key, ())
        if not report.has_test:
            if grown.pop(key, ()):
                retired.append(f"{name}, which was {past[-1].outcome}: {printable(report.reason)}")
            continue
        if not report.outcome.judged:
            kept = f"it stays {past[-1].outcome}, accepted on {past[-1].accepted}" if past else "nothing is accepted"
            left.append(f"{name} is {report.outcome} now ({printable(report.reason)}): {kept}")
            continue
        entry = entry_of(report, archive, today)
        changed = difference(past[-1] if past else None, entry)
        if changed:
            grown[key] = (*past, entry)
            accepted.append(f"{name}: {changed}")
    return Acceptance(grown, tuple(accepted), tuple(retired), tuple(left))


def entry_of(report: ClaimReport, judged_from: Archive | Store, today: str) -> AcceptedVerdict:
    """Return the entry that records a claim, which was judged from trials of an archive, or of a store alone.

    Raises:
        UserError: when a trial behind it is damaged.
    """
    preferred = {trial: source.installed for source in report.sources for trial in source.trials}
    found = (judged_from.get(trial, versions) for trial, versions in preferred.items())
    trials = [trial for trial in found if trial is not None]
    return AcceptedVerdict(
        outcome=report.outcome,
        reason=printable(report.reason),
        n=report.n,
        p=report.p,
        fingerprint=report.fingerprint,
        accepted=today,
        versions=versions_of(trials),
        device=_joined(trial.device.get("kind") for trial in trials),
        revision=_joined(_revision(trial) for trial in trials),
        trials=content_hash(sorted(trial.digest for trial in trials)),
    )


def versions_of(trials: Sequence[TrialResult]) -> dict[str, str]:
    """Return the versions that trials were made with, by package; CUDA's too if a GPU made them."""
    made_with = [_packages(trial) for trial in trials]
    names = sorted({name for packages in made_with for name in packages})
    return {printable(name): _joined(packages.get(name) for packages in made_with) for name in names}


def difference(old: AcceptedVerdict | None, new: AcceptedVerdict) -> str:
    """Describe what a new entry changes; empty if it need not be recorded."""
    if old is None:
        return f"{new.outcome}, the first verdict"
    moved = changes(old, new)
    by = f" (by {', '.join(moved)})" if moved else ""
    if old.fingerprint != new.fingerprint:
        return f"{new.outcome}; a new history begins, since what is judged has changed (it was {old.outcome}){by}"
    if old.outcome != new.outcome:
        return f"{old.outcome} -> {new.outcome}{by}"
    if old.reason != new.reason and old.trials != new.trials:
        return f"still {new.outcome}, by other trials{by}"
    if old.trials == new.trials and not _alike(old, new):  # the judge computes it otherwise, or the file was edited
        return f"still {new.outcome}, from the same trials with another p or n ({old.p} of {old.n} before){by}"
    return f"still {new.outcome}{by}" if moved else ""


def _alike(old: AcceptedVerdict, new: AcceptedVerdict) -> bool:
    """Whether two entries have the same n, and the same p but for rounding."""
    if old.p is None or new.p is None:
        return (old.n, old.p) == (new.n, new.p)
    return old.n == new.n and math.isclose(old.p, new.p, rel_tol=1e-6, abs_tol=1e-300)


def changes(old: AcceptedVerdict, new: AcceptedVerdict) -> list[str]:
    """Describe the packages whose versions differ, such as "jax 0.10.2 -> 0.11.2", and the device."""
    names = sorted(old.versions.keys() | new.versions.keys())
    pairs = [(name, old.versions.get(name, "none"), new.versions.get(name, "none")) for name in names]
    pairs.append(("device", old.device or "unknown", new.device or "unknown"))
    return [f"{name} {was} -> {now}" for name, was, now in pairs if was != now]


def _packages(trial: TrialResult) -> dict[str, str]:
    """Return the versions of one trial; a package that was not installed is left out."""
    cuda = trial.provenance.get("cuda") if trial.device.get("platform") == "gpu" else None
    found = {**(trial.provenance.get("versions") or {}), **(cuda or {})}
    return {str(name): str(version) for name, version in found.items() if version is not None}


def _revision(trial: TrialResult) -> str | None:
    """Return the git revision of a trial, as `git describe --dirty` would."""
    git = trial.provenance.get("git") or {}
    return f"{git['sha']}-dirty" if git.get("sha") and git.get("dirty") else git.get("sha")


def _joined(values: Iterable[Any]) -> str:
    """Return the different values as one text; unknown ones are left out."""
    return ", ".join(sorted({printable(value) for value in values if value}))
