"""`evoclaims replicate`: the paper's numbers beside those of the trials at hand; nothing is run."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from rich.cells import cell_len
from rich.table import Table

from evoclaims.cli.project import Project, open_project
from evoclaims.cli.terminal import REPORT, styled, write
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.figures.figure import SIZES
from evoclaims.figures.replication import Replication, replications
from evoclaims.judging.repetition import Answer, Prediction, Spread
from evoclaims.report import replication_cells
from evoclaims.report.console import GAP, PlainSpokenConsole, plain_table
from evoclaims.report.formatting import number
from evoclaims.report.replication_cells import PROTOCOL, SYMBOLS, ours, published
from evoclaims.verdicts import export

LEGEND: Final = ", ".join(f"{symbol} {answer}" for answer, symbol in SYMBOLS.items())
"""What the symbols stand for."""

_HEADINGS: Final = ("", "", "published", "ours", "95% of repetitions")


def blocks(found: Sequence[Replication], width: int) -> Iterator[tuple[str, Table]]:
    """Yield the heading of each block and its table, whose columns have the same places in all.

    A block holds the levels of one condition under one variant ("neat on n_parity: success, rows_so_far"), or where a
    task has no levels the methods on it ("obstacles: episode reward").

    Args:
        found: the numbers.
        width: columns of the terminal. Where it is too narrow, two readings of an error bar have a line each.
    """
    varied = any(one.variant for one in found)
    made: dict[str, list[tuple[tuple[str, ...], list[str]]]] = {}
    for one in found:
        heading, label = _place(one, varied)
        cells = SYMBOLS[one.agreement], label, published(one), ours(one)
        made.setdefault(heading, []).append((cells, _intervals(one)))
    rows = [_HEADINGS, *((*cells, ", ".join(intervals)) for block in made.values() for cells, intervals in block)]
    widths = [max(map(cell_len, column)) for column in zip(*rows, strict=True)]
    between = ",\n" if sum(widths) + GAP * (len(widths) - 1) > width else ", "
    for place, (heading, block) in enumerate(made.items()):
        lines = [(*cells, between.join(intervals)) for cells, intervals in block]
        table = plain_table(_HEADINGS, lines, names=len(_HEADINGS))
        for column, least in zip(table.columns[:-1], widths, strict=False):
            column.min_width = least
        table.show_header = not place
        yield heading, table


def _place(one: Replication, varied: bool) -> tuple[str, str]:
    """Return the heading that a number belongs to, with the variant if several are shown, and its name below it."""
    found = one.numbers
    under = f", {one.variant or PROTOCOL}" if varied else ""
    if one.level is None:
        return f"{found.task}: {found.name}{under}", found.method
    return f"{found.method} on {found.task}: {found.name}{under}", f"level {one.level}"


def _intervals(one: Replication) -> list[str]:
    """Return the interval by each reading of the published spread, or why it is missing."""
    return [*map(_interval, one.repetition.predictions)] or [one.repetition.reason]


def _interval(prediction: Prediction) -> str:
    """Return an interval, such as "0.776–0.938 SD ✗", or "7–10 trials at 1: ours 2"."""
    ends = f"{number(prediction.low)}–{number(prediction.high)}"
    if prediction.spread is Spread.NONE:
        got = "" if prediction.ours is None else f": ours {number(prediction.ours)}"
        return f"{ends} {prediction.of}{got}"
    mark = {Answer.INSIDE: " ✓", Answer.OUTSIDE: " ✗"}.get(prediction.answer, "")
    return f"{ends} {prediction.spread.short}{mark}"


ALL: Final = "all"

_FORMS: Final[Mapping[str, Callable[[Sequence[Replication]], bytes]]] = {
    "csv": lambda found: export.as_csv([one.row() for one in found]),
    "json": lambda found: export.as_json([one.row() for one in found]),
    "markdown": lambda found: (replication_cells.markdown(found) + "\n").encode(),
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
    for heading, table in blocks(found, console.width):
        console.print(f"\n{heading}", style="bold")
        console.print(table)
    console.print(f"\n{LEGEND}. {replication_cells.HOW}")
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
