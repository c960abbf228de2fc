"""Claims by environments, and accepted verdicts by date, as charts."""

from __future__ import annotations

from evoclaims.report import across_table
from evoclaims.report.verdict_chart import VerdictChart, VerdictMark
from evoclaims.verdicts import timeline
from evoclaims.verdicts.across import Across, Cell
from evoclaims.verdicts.history import History


def across_chart(found: Across) -> VerdictChart:
    """Return a chart in which marks are as high as A12 against the first environment."""
    rows = {
        claim: {one.label: _mark(found.cells.get((claim, one.label)), one.trouble) for one in found.environments}
        for claim in found.claims
    }
    labels = {one.label: one.label for one in found.environments}
    return VerdictChart(across_table.headline(found), "height: A12; ring: drift", labels, rows)


def timeline_chart(history: History, claim: str = "") -> VerdictChart:
    """Return a chart of accepted verdicts by date and versions; a ring is a verdict under other rules than before.

    Raises:
        UserError: as `timeline.timeline` does.
    """
    columns: dict[str, str] = {}
    rows: dict[str, dict[str, VerdictMark]] = {}
    for tier, name in timeline.chosen(history, claim):
        marks = rows.setdefault(f"{name} ({tier})", {})
        before = None
        for entry in history[tier, name]:
            versions = ", ".join(f"{package} {version}" for package, version in sorted(entry.versions.items()))
            column = f"{entry.accepted}: {versions}"
            columns[column] = f"{entry.accepted}, jax {entry.versions.get('jax', 'unknown')}"
            ringed = before is not None and before.fingerprint != entry.fingerprint
            marks[column] = VerdictMark(entry.outcome, timeline.described(before, entry), ringed=ringed)
            before = entry
    title, note = "Accepted verdicts by date", "ring: other rules than before"
    return VerdictChart(title, note, dict(sorted(columns.items())), rows)


def _mark(cell: Cell | None, trouble: str) -> VerdictMark:
    """Return the mark of a claim in an environment, which says what the table says."""
    if cell is None:
        return VerdictMark(None, trouble or "no verdict")
    a12 = 0.5 if cell.drift is None or cell.drift.a12 is None else cell.drift.a12
    return VerdictMark(cell.outcome, "; ".join(across_table.cell_lines(cell)), a12, cell.drifted)
