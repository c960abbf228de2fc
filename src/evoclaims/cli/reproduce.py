"""`evoclaims reproduce`: a figure or table of the paper, redrawn from the trials at hand; nothing is run.

A figure without any trials is written too, and says so. The status is 1 when nothing at all could be drawn.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from evoclaims.cli.project import open_project
from evoclaims.cli.terminal import FIGURES, write
from evoclaims.figures.figure import Drawing, load, names
from evoclaims.figures.sheet import contents
from evoclaims.paper.reproduction import Conditions

ALL = "all"


def main(options: argparse.Namespace) -> int:
    """Draw, write and report what is missing; 1 when no requested figure shows a measured number."""
    project = open_project(options.storage)
    reproduction = project.reproduction
    reproduction.tier(options.tier, options.variant)
    known = names(reproduction)
    chosen = known if options.figure == ALL and known else (options.figure,)
    figures = [load(reproduction, name) for name in chosen]
    at = f"{options.tier}-{options.variant}" if options.variant else options.tier
    folder = FIGURES / at if options.out is None else Path(options.out)
    shown = 0
    for figure in figures:
        drawing = figure.draw(project.archive, reproduction, options.tier, options.variant)
        for ending, data in contents(drawing).items():
            write(folder / f"{figure.name}.{ending}", data, "folder", ours=options.out is None)
        print(f"{figure.name}: wrote {folder / figure.name}.png, .svg and .csv")
        if options.variant and not _changed(drawing, reproduction.changed_by(options.variant, options.tier)):
            print(f"  {options.variant} changes none of its trials: it is the same as without --variant")
        for sentence in drawing.missing:
            print(f"  {sentence}")
        shown += drawing.shown
    if not shown:
        selected = f"--tier {options.tier} --variant {options.variant}"
        if not options.variant:  # what no claim needs runs only by its names
            selected = f"METHOD --on TASK --tier {options.tier}"
        print(
            f"Nothing could be drawn: of {', '.join(chosen)} no trial of the {options.tier} tier is at hand. "
            f"`evoclaims run {selected}{project.store.option}` runs them."
        )
    return int(not shown)


def _changed(drawing: Drawing, changes: Conditions) -> bool:
    """Whether a drawing shows trials that a variant changes; True for one that does not tell whose numbers it has."""
    table = drawing.table
    if not {"method", "task"} <= set(table.columns):
        return True
    return any(names in changes for names in zip(table["method"], table["task"], strict=True))
