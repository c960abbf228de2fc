"""The history of a claim's accepted verdicts, and what differs now."""

from __future__ import annotations

from collections.abc import Sequence

from evoclaims.report.model import AcceptedVerdict
from evoclaims.verdicts.acceptance import UNDECIDED
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import Entry, eras


def accepted(entries: Sequence[Entry]) -> tuple[AcceptedVerdict, ...]:
    """Return accepted verdicts as they are shown, oldest first."""
    return tuple(
        AcceptedVerdict(
            entry,
            new_rules=number > 0 and index == 0,
            made=f"{entry.device}, revision {_short(entry.revision)}",
            versions=", ".join(f"{name} {version}" for name, version in sorted(entry.versions.items())),
        )
        for number, era in enumerate(eras(entries))
        for index, entry in enumerate(era)
    )


def change(entries: Sequence[Entry], report: ClaimReport) -> str:
    """Say what differs from the verdict that was accepted last; nothing where that cannot be told."""
    if not entries or report.verdict is None or report.outcome in UNDECIDED:
        return ""
    last = entries[-1]
    if last.fingerprint != report.fingerprint:
        return f"What was fixed beforehand has changed since {last.accepted}: a new history begins."
    if last.outcome != report.outcome:
        return f"Accepted on {last.accepted} as {last.outcome}; now {report.outcome}."
    return ""


def _short(revision: str) -> str:
    """Shorten revisions, which may be several and say that files differed."""
    cut = ((text[:9] + ("-dirty" if text.endswith("-dirty") else "")) for text in revision.split(", "))
    return ", ".join(cut) or "unknown"
