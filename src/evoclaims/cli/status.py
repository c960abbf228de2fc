"""`evoclaims status`: the verdict table from the store."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from rich.console import Console

from evoclaims.claims.selection import selected
from evoclaims.cli.project import open_project
from evoclaims.cli.terminal import styled
from evoclaims.core.errors import UnknownNameError
from evoclaims.judging.verdict import Outcome
from evoclaims.report import table_cells, terminal_table
from evoclaims.report.run_summary import run_summary
from evoclaims.verdicts import export
from evoclaims.verdicts.claim_report import ClaimReport

FORMS: Final[Mapping[str, Callable[[Sequence[ClaimReport]], str]]] = {
    "csv": lambda reports: export.as_csv(export.verdict_rows(reports)).decode(),
    "json": lambda reports: export.as_json(export.verdict_rows(reports)).decode(),
    "markdown": run_summary,
}
"""Ways to print verdicts for other programs, by name."""


def main(options: argparse.Namespace) -> int:
    """Print the verdicts; 1 when something is refuted or broken without being accepted."""
    if options.form not in (None, *FORMS):
        raise UnknownNameError("form of a table", options.form, FORMS)
    project = open_project(options.storage)
    project.reproduction.tier(options.tier)
    reports = table_cells.ordered(project.judge(options.tier))
    if options.only is not None:
        wanted = selected(options.only, {name for report in reports for name in (report.claim, report.name)})
        reports = [report for report in reports if wanted & {report.claim, report.name}]
    if options.form is None:
        _print(reports, options.tier, options.why)
    else:
        print(FORMS[options.form](reports), end="")
    return int(any(report.failed for report in reports))


def _print(reports: Sequence[ClaimReport], tier: str, why: bool) -> None:
    """Print the table, and why claims have failed; why every claim is not plainly supported where that is asked for."""
    explained = [report for report in reports if why or report.failed]
    accepted = any(report.as_expected and report.outcome is not Outcome.SUPPORTED for report in reports)
    unexplained = accepted or any(report.outcome is Outcome.INCONCLUSIVE for report in reports)
    console = Console(file=styled())
    for part in (
        terminal_table.verdict_table(reports, console.width, console.is_terminal),
        terminal_table.explanations(explained, console.width, console.is_terminal),
        "--why says why verdicts are accepted, or inconclusive" if unexplained and not why else "",
        table_cells.faults(reports),
        f"claims ({tier}): {table_cells.totals(reports)}",
    ):
        if part:
            print(part, file=styled())
