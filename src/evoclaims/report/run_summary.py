"""The verdicts of a run: its last lines on the terminal, and Markdown for continuous integration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from evoclaims.judging.verdict import Outcome
from evoclaims.report import table_cells
from evoclaims.report.formatting import listed, literal, plural, table
from evoclaims.verdicts import history, other_code
from evoclaims.verdicts.claim_report import ClaimReport

COLUMNS = ("claim", "what is claimed", "verdict", "n", "p", "why")


def run_summary(reports: Sequence[ClaimReport], notes: Sequence[str] = ()) -> str:
    """Return a table of verdicts, their totals, and plain `notes`, such as changes against the accepted verdicts."""
    rows = (map(literal, _cells(report)) for report in history.ordered(reports))
    lines = ["## Claims", "", f"**{literal(table_cells.totals(reports))}**", ""]
    lines += [table(COLUMNS, rows, numbers=("n", "p"))]
    of_trials = other_code.lines(reports)
    further = filter(None, (table_cells.faults(reports), *of_trials, *notes))
    lines += ["", *(f"* {literal(note)}" for note in further)]
    return "\n".join(lines).rstrip("\n") + "\n"


def _cells(report: ClaimReport) -> tuple[str, ...]:
    because = f"; examined and accepted: {report.because}" if report.as_expected and report.because else ""
    return (
        f"{report.name} ({report.tier})",
        f"{report.statement} ({report.where})",
        table_cells.verdict_of_versions(report),
        table_cells.trials(report),
        table_cells.p(report, attainable=False),
        "" if report.outcome is Outcome.SUPPORTED and not because else f"{report.reason}{because}",
    )


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


def closing_lines(
    reports: Sequence[ClaimReport],
    changed: Sequence[str] | None,
    drifted: Sequence[str],
    regressed: Sequence[str] = (),
    errors: int = 0,
) -> list[str]:
    """Return three lines; the first names all that makes the run fail.

    Args:
        reports: of the run.
        changed: claims whose verdicts differ from the accepted ones; None if nothing has been accepted yet.
        drifted: conditions whose trials have drifted.
        regressed: those of `changed` that make the run fail.
        errors: sentences above that make the run fail, too.
    """
    failed = [report for report in reports if report.failed]
    drifts = [f"trials of {label} (drift)" for label in drifted]
    changes = [*(changed or ()), *drifts]
    nothing = "nothing" if changed is not None else "nothing to compare with: no verdict has been accepted"
    above = ["what the error above says" if errors == 1 else f"what {errors} errors above say"] * bool(errors)
    failures = [*above, *(f"{one.name} ({one.outcome})" for one in failed)]
    return [
        _line("failed: ", [*failures, *(f"{name}, regression" for name in regressed), *drifts], "nothing"),
        _line("changed: ", changes, nothing),
        f"next: {above[0] if above else _next(failed, changes, changed is None)}",
    ]


def _line(begin: str, names: Sequence[str], nothing: str) -> str:
    """Return a line with as many names as it has room for."""
    lines = (begin + (listed(names, most) or nothing) for most in range(_NAMED, 0, -1))
    return next((line for line in lines if len(line) <= _WIDTH), f"{begin}{listed(names, 1)}")


def _next(failed: Sequence[ClaimReport], changes: Sequence[str], first: bool) -> str:
    if failed:
        names = ",".join(dict.fromkeys(report.claim for report in failed[:_NAMED]))
        return f"evoclaims status --tier {failed[0].tier} --only {names} --why   (the reasons)"
    if changes:
        return "evoclaims compare   (every change), then evoclaims accept   (the current verdicts)"
    if first:
        return "evoclaims accept   (later runs compare with these verdicts)"
    return "evoclaims report   (a page of every claim with its trials)"
