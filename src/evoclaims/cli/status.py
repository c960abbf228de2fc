"""`evoclaims status`: the verdict table from the store."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from rich.console import Console

from evoclaims.claims.claim_names import selected
from evoclaims.cli.project import Project, open_project
from evoclaims.cli.terminal import styled
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.judging.verdict import Outcome
from evoclaims.paper.reproduction import Reproduction
from evoclaims.report import table_cells, terminal_table
from evoclaims.report.run_summary import run_summary
from evoclaims.verdicts import export, history
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.transitions import matrix

FORMS: Final[Mapping[str, Callable[[Sequence[ClaimReport]], str]]] = {
    "csv": lambda reports: export.as_csv(export.verdict_rows(reports)).decode(),
    "json": lambda reports: export.as_json(export.verdict_rows(reports)).decode(),
    "markdown": run_summary,
}
"""Ways to print verdicts for other programs, by name."""


def main(options: argparse.Namespace) -> int:
    """Print the verdicts; 1 when something is refuted or broken without being accepted, under a variant if broken."""
    if options.form not in (None, *FORMS):
        raise UnknownNameError("form of a table", options.form, FORMS)
    project = open_project(options.storage)
    project.reproduction.tier(options.tier, options.variant)
    names = [options.variant, ""] if options.variant else [""]
    reports, *plain = map(history.ordered, project.judge_variants([(options.tier, name) for name in names]))
    if options.only is not None:
        wanted = selected(options.only, {name for report in reports for name in (report.claim, report.name)})
        reports = [report for report in reports if wanted & {report.claim, report.name}]
    if options.variant:  # what it does not change, or has no trials, is left out
        reports = [report for report in reports if report.outcome is not Outcome.NOT_RUN]
        if not reports:
            raise UserError(
                f"None of these claims of the {options.tier} tier is judged under {options.variant}: it "
                "changes none of their trials, or they have not run. Run what is missing with `evoclaims "
                f"run --variant {options.variant} --tier {options.tier}{project.store.option}`."
            )
    if options.form is None:
        _print(reports, options.tier, options.why)
        if note := _where_from(reports, project):
            print(note)
        for protocol in plain:
            print(_changes(protocol, reports, project.reproduction, options.variant))
    else:
        print(FORMS[options.form](reports), end="")
    return int(any(report.failed for report in reports))


def _where_from(reports: Sequence[ClaimReport], project: Project) -> str:
    """Say how many claims were judged from committed reference trials, which went before those of the store.

    Imported trials are in no store.
    """
    imported = {condition.id for condition in project.reproduction.imported}
    judged = [report for report in reports if report.n]
    lacking = [
        report
        for report in judged
        if any(
            project.archive.stored(trial, source.installed) is None
            for source in report.sources
            if source.condition not in imported
            for trial in source.trials
        )
    ]
    if not lacking:
        return ""
    some = "all" if len(lacking) == len(judged) else f"{len(lacking)} of {len(judged)}"
    return f"judged from committed reference trials, since the store has no better ones: {some} of these claims"


def _changes(
    plain: Sequence[ClaimReport], varied: Sequence[ClaimReport], reproduction: Reproduction, variant: str
) -> str:
    """Say which of the shown verdicts are others under the protocol itself."""
    rows = [row for row in matrix(plain, {variant: varied}) if row.hangs_on]
    changed = ", ".join(f"{row.claim} {row.plain} -> {row.outcomes[variant]}" for row in rows)
    return (
        f"{variant}: {reproduction.variants[variant].says}\n"
        f"verdicts that it changes: {len(rows)} of {len(varied)}{f' ({changed})' if changed else ''}"
    )


def _print(reports: Sequence[ClaimReport], tier: str, why: bool) -> None:
    """Print the table, and why claims have failed; why every claim is not plainly supported where that is asked for."""
    explained = [report for report in reports if why or report.failed]
    accepted = any(report.as_expected and report.outcome is not Outcome.SUPPORTED for report in reports)
    unexplained = accepted or any(report.outcome in (Outcome.INCONCLUSIVE, Outcome.NOT_RUN) for report in reports)
    console = Console(file=styled())
    width = terminal_table.columns(console.width, console.is_terminal)
    for part in (
        terminal_table.verdict_table(reports, width, console.is_terminal, console.encoding),
        terminal_table.explanations(explained, width, console.is_terminal),
        "--why prints why verdicts are accepted, inconclusive or not run" if unexplained and not why else "",
        table_cells.faults(reports),
        f"claims ({tier}): {table_cells.totals(reports)}",
    ):
        if part:
            print(part, file=styled())
