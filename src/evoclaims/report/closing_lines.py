"""The last lines of a run: what failed, what changed, what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from evoclaims.report.formatting import listed, plural
from evoclaims.verdicts.claim_report import ClaimReport

_NAMED: Final = 4
"""Names in a line at most; the number of the others follows."""

_WIDTH: Final = 100
"""Columns of a line, unless one name is longer."""


def without_smoke_test(reports: Sequence[ClaimReport]) -> str:
    """Return a line that counts the claims without a test at the smoke tier; empty if all have one."""
    claims = {report.claim for report in reports if not report.has_test}
    if not claims:
        return ""
    have = "has" if len(claims) == 1 else "have"
    return f"{plural(len(claims), 'claim')} {have} no smoke test: evoclaims status --why"


def closing_lines(reports: Sequence[ClaimReport], changed: Sequence[str] | None, drifted: Sequence[str]) -> list[str]:
    """Return three lines.

    Args:
        reports: of the run.
        changed: claims whose verdicts differ from the accepted ones; None if nothing has been accepted yet.
        drifted: conditions whose trials have drifted.
    """
    failed = [report for report in reports if report.failed]
    changes = [*(changed or ()), *(f"trials of {label} (drift)" for label in drifted)]
    nothing = "nothing" if changed is not None else "nothing to compare with: no verdict has been accepted"
    return [
        _line("failed: ", [f"{one.name} ({one.outcome})" for one in failed], "nothing"),
        _line("changed: ", changes, nothing),
        f"next: {_next(failed, changes, changed is None)}",
    ]


def _line(begin: str, names: Sequence[str], nothing: str) -> str:
    """Return a line with as many names as it has room for."""
    lines = (begin + (listed(names, most) or nothing) for most in range(_NAMED, 0, -1))
    return next((line for line in lines if len(line) <= _WIDTH), f"{begin}{listed(names, 1)}")


def _next(failed: Sequence[ClaimReport], changes: Sequence[str], first: bool) -> str:
    """Return the command that helps most."""
    if failed:
        names = ",".join(dict.fromkeys(report.claim for report in failed[:_NAMED]))
        return f"evoclaims status --tier {failed[0].tier} --only {names} --why   (the reasons)"
    if changes:
        return "evoclaims compare   (every change), then evoclaims accept   (the current verdicts)"
    if first:
        return "evoclaims accept   (later runs compare with these verdicts)"
    return "evoclaims report   (a page of every claim with its trials)"
