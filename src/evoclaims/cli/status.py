"""`evoclaims status`: the verdict table from the store."""

from __future__ import annotations

import argparse

from rich.console import Console

from evoclaims.cli.project import open_project
from evoclaims.cli.terminal import styled
from evoclaims.report import table_cells, terminal_table


def main(options: argparse.Namespace) -> int:
    """Print the table; 1 when something is refuted or broken without being accepted."""
    project = open_project(options.storage)
    project.reproduction.tier(options.tier)
    reports = project.judge(options.tier)
    console = Console(file=styled())
    for part in (
        terminal_table.verdict_table(reports, console.width, console.is_terminal),
        terminal_table.explanations(reports, console.width, console.is_terminal),
        table_cells.faults(reports),
        f"claims ({options.tier}): {table_cells.totals(reports)}",
    ):
        if part:
            print(part, file=styled())
    return int(any(report.failed for report in reports))
