"""The verdicts of a run as Markdown, for its summary page in continuous integration."""

from __future__ import annotations

from collections.abc import Sequence

from evoclaims.judging.verdict import Outcome
from evoclaims.report import table_cells
from evoclaims.report.markdown_text import literal, table
from evoclaims.verdicts import edited_code, history, mixed_versions
from evoclaims.verdicts.claim_report import ClaimReport

COLUMNS = ("claim", "what is claimed", "verdict", "n", "p", "why")


def run_summary(reports: Sequence[ClaimReport], notes: Sequence[str] = ()) -> str:
    """Return a table of verdicts, their totals, and plain `notes`, such as changes against the accepted verdicts."""
    rows = (map(literal, _cells(report)) for report in history.ordered(reports))
    lines = ["## Claims", "", f"**{literal(table_cells.totals(reports))}**", ""]
    lines += [table(COLUMNS, rows, numbers=("n", "p"))]
    of_trials = (*mixed_versions.lines(reports), *edited_code.lines(reports))
    further = filter(None, (table_cells.faults(reports), *of_trials, *notes))
    lines += ["", *(f"* {literal(note)}" for note in further)]
    return "\n".join(lines).rstrip("\n") + "\n"


def _cells(report: ClaimReport) -> tuple[str, ...]:
    """Return a row of the table."""
    because = f"; looked into and accepted: {report.because}" if report.as_expected and report.because else ""
    return (
        f"{report.name} ({report.tier})",
        f"{report.statement} ({report.where})",
        table_cells.verdict_of_versions(report),
        table_cells.trials(report),
        table_cells.p(report, attainable=False),
        "" if report.outcome is Outcome.SUPPORTED and not because else f"{report.reason}{because}",
    )
