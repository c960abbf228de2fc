"""`evoclaims reproduce`: a figure or table of the paper, redrawn from the trials at hand; nothing is run.

A figure none of whose trials exist is written too, and says so. The status is 1 when nothing at all could be drawn.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from evoclaims.cli.project import open_archive, open_project
from evoclaims.core.errors import UserError
from evoclaims.core.files import write_atomically
from evoclaims.figures import catalogue, files
from evoclaims.figures.figure import Drawing

ALL = "all"


def main(options: argparse.Namespace) -> int:
    """Draw, write and say what is missing; 1 when no figure that was asked for shows a number of ours."""
    _, reproduction = open_project()
    reproduction.tier(options.tier)
    known = catalogue.names(reproduction)
    names = known if options.figure == ALL and known else (options.figure,)
    figures = [catalogue.load(reproduction, name) for name in names]
    archive = open_archive(options.storage, reproduction)
    folder = Path("figures", options.tier) if options.out is None else Path(options.out)
    shown = 0
    for figure in figures:
        drawing = figure.draw(archive, reproduction, options.tier)
        _write(drawing, folder, figure.name)
        print(f"{figure.name}: wrote {folder / figure.name}.png, .svg and .csv")
        for sentence in drawing.missing:
            print(f"  {sentence}")
        shown += drawing.shown
    if not shown:
        print(
            f"Nothing could be drawn: of {', '.join(names)} no trial of the {options.tier} tier is at hand. "
            f"`evoclaims run --tier {options.tier}` runs them."
        )
    return int(not shown)


def _write(drawing: Drawing, folder: Path, name: str) -> None:
    """Write a drawing's files."""
    for ending, data in files.contents(drawing).items():
        path = folder / f"{name}.{ending}"
        try:
            write_atomically(path, data)
        except UserError as error:
            reason = getattr(error.__cause__, "strerror", None) or error.__cause__
            raise UserError(f"Cannot write {path}: {reason}. Name another folder with --out.") from error
