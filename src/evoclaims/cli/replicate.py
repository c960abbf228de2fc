"""`evoclaims replicate`: the paper's numbers beside those of the trials at hand; nothing is run."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from evoclaims.cli.output_files import REPORT, write
from evoclaims.cli.project import Project, open_project
from evoclaims.cli.terminal import styled
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.figures.figure import SIZES
from evoclaims.figures.replication import Replication, replications
from evoclaims.report import replication_blocks, replication_cells
from evoclaims.report.console import PlainSpokenConsole
from evoclaims.report.markdown import numbers
from evoclaims.verdicts import export

ALL: Final = "all"

_FORMS: Final[Mapping[str, Callable[[Sequence[Replication]], bytes]]] = {
    "csv": lambda found: export.as_csv([one.row() for one in found]),
    "json": lambda found: export.as_json([one.row() for one in found]),
    "markdown": lambda found: (numbers(found) + "\n").encode(),
}
"""Writers by the names of their forms."""


def main(options: argparse.Namespace) -> int:
    """Print the table, and what the claims' assertions make of the published numbers; or write the table to a file."""
    if options.form not in (None, *_FORMS):
        raise UnknownNameError("form", options.form, _FORMS)
    project = open_project(options.storage)
    found = _found(project, options.tier, options.variant)
    if options.form:
        out = Path(options.out or REPORT / f"replication.{options.form}")
        write(out, _FORMS[options.form](found), ours=options.out is None)
        print(f"wrote {out}: {len(found)} numbers")
        return 0
    console = PlainSpokenConsole(file=styled())
    size = SIZES.get(options.tier, f"{options.tier} tier")
    console.print(f"Published numbers and ours ({size})")
    for heading, table in replication_blocks.blocks(found, console.width):
        console.print(f"\n{heading}", style="bold")
        console.print(table)
    console.print(f"\n{replication_blocks.LEGEND}. {replication_cells.HOW}")
    (reports,) = project.judge_sessions([(project.as_published(options.tier), options.tier)])
    for line in (*replication_cells.totals(found), *replication_cells.put_to_the_paper(reports)):
        console.print(line)
    return 0


def _found(project: Project, tier: str, variant: str) -> tuple[Replication, ...]:
    """Return the published numbers beside ours, under the variants that are asked for.

    Raises:
        UserError: when there are none.
    """
    reproduction = project.reproduction
    variants = ("", *reproduction.variants) if variant == ALL else (variant,)
    found = replications(project.archive, reproduction, tier, variants)
    if not reproduction.published.plots:
        raise UserError(
            f"{reproduction.folder / 'reported.toml'} has no published numbers. Write the paper's numbers into it."
        )
    if not found:
        raise UserError(
            f"There are no trials of the {tier} tier under {variant} whose numbers are published. Run "
            f"them with `evoclaims run --tier {tier} --variant {variant}`."
        )
    return found
