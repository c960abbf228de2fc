"""Verdicts as a table for the terminal."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from rich.markup import escape
from rich.table import Table

from evoclaims.core.printable import printable
from evoclaims.judging.baseline import DriftReport
from evoclaims.judging.verdict import Outcome
from evoclaims.report import table_cells
from evoclaims.report.console import PlainSpokenConsole
from evoclaims.verdicts import mixed_versions
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.sensitivity import Tried

WIDE = 120
"""Columns from which each claim's file of evidence is shown too."""

_COLOURS = {
    Outcome.SUPPORTED: "green",
    Outcome.REFUTED: "red",
    Outcome.INCONCLUSIVE: "yellow",
    Outcome.ERROR: "bold red",
    Outcome.NOT_RUN: "dim",
}


def verdict_table(reports: Sequence[ClaimReport], width: int, colour: bool) -> str:
    """Return the table: claim, sentence, verdict, n, effect, p beside the attainable p, evidence."""
    table = Table(expand=True, show_lines=False, pad_edge=False, box=None)
    wide = width >= WIDE
    # On a narrow terminal a long list of parameters must not squeeze the sentence.
    table.add_column("claim", no_wrap=wide, overflow="fold", max_width=None if wide else 16)
    table.add_column("what is claimed", ratio=1, min_width=16)
    for heading in ("verdict", "n", "A12"):
        table.add_column(heading, no_wrap=True, justify="left" if heading == "verdict" else "right")
    # "against 5.4e-06 (5.4e-06)" wraps to a second line, as most sentences do, and leaves them room.
    table.add_column("p (attainable)", max_width=17)
    if wide:
        table.add_column("evidence", no_wrap=True, style="dim")
    for report in table_cells.ordered(reports):
        cells = (
            _literal(report.name),
            _literal(f"{report.statement} ({report.where})"),
            f"[{_COLOURS[report.outcome]}]{table_cells.verdict_of_versions(report)}[/]".replace(", ", ",\n"),
            table_cells.trials(report),
            table_cells.effect(report),
            table_cells.p(report),
            _literal(Path(report.evidence).name),
        )
        table.add_row(*(cells if wide else cells[:-1]))
    folders = sorted({os.path.relpath(Path(report.evidence).parent) for report in reports if report.evidence})
    captions = [f"evidence: {printable(folder)}/<claim>.json" for folder in folders]
    if any(report.as_expected for report in reports):
        captions.append("* looked into and accepted, see below")
    if any(report.tried is Tried.INSENSITIVE for report in reports):
        captions.append("insensitive: no fault planted in the claim's methods changes its verdict, so it is no support")
    captions += mixed_versions.lines(reports)
    return "\n".join([_rendered(table, width, colour), *captions])


def explanations(reports: Sequence[ClaimReport], width: int, colour: bool) -> str:
    """Return a line for every verdict that is not plainly supported: why, what was accepted, which trials broke."""
    lines = []
    for report in reports:
        broken = report.verdict.without_result if report.verdict else ""
        if report.outcome == Outcome.SUPPORTED and report.expected in (None, report.outcome) and not broken:
            continue
        note = ""
        if report.expected is not None and report.outcome != Outcome.NOT_RUN:
            kept = "accepted" if report.as_expected else f"no longer {report.expected}, which was accepted"
            note = f" [{kept}: {report.because}]"
        worst = f" [worst rank: {broken}]" if broken else ""
        lines.append(f"{report.outcome.symbol} {report.name}: {report.reason}{worst}{note}")
    return _rendered("\n".join(_literal(line) for line in lines), width, colour) if lines else ""


def drift_lines(drift: DriftReport, changed: int, compared: int) -> str:
    """Return what the comparison with the committed reference trials found."""
    drifted = sum(row.drifted for row in drift.rows)
    head = (
        f"reference trials: {drift.tested} comparisons, {drifted} drifted (exact rank tests, Holm, α = {drift.alpha:g})"
    )
    bits = (
        f"to the bit: {compared} trials compared with the same machine and versions, {changed} changed"
        if compared
        else "to the bit: no trial could be compared, since none of the references has the same machine and versions"
    )
    return "\n".join([head, *drift.lines, bits])


def _literal(text: str) -> str:
    """Return text as markup that shows it as it is, on one line."""
    return escape(" ".join(text.split()))


def _rendered(content: Table | str, width: int, colour: bool) -> str:
    """Return rich content as text."""
    file = io.StringIO()
    system: Literal["standard"] | None = "standard" if colour else None
    console = PlainSpokenConsole(file=file, width=max(width, 60), force_terminal=colour, color_system=system)
    console.print(content, highlight=False)
    return file.getvalue().rstrip("\n")
