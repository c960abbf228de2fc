"""The paper's figures, redrawn for a report."""

from __future__ import annotations

from evoclaims.core.errors import UserError
from evoclaims.figures import catalogue, files
from evoclaims.paper.archive import Archive
from evoclaims.paper.reproduction import Reproduction
from evoclaims.report.formatting import listed
from evoclaims.report.model import PaperFigure


def paper_figures(
    reproduction: Reproduction, archive: Archive, tier: str
) -> tuple[tuple[PaperFigure, ...], tuple[str, ...]]:
    """Return the figures with something to draw at a tier, and sentences about the others."""
    drawn: list[PaperFigure] = []
    empty: list[str] = []
    broken: dict[str, list[str]] = {}
    for name in catalogue.names(reproduction):
        try:
            drawing = catalogue.load(reproduction, name).draw(archive, reproduction, tier)
            if drawing.shown:
                says = " ".join((*drawing.caption, *drawing.missing))
                drawn.append(PaperFigure(drawing.title, says, files.svg(drawing).encode()))
            else:
                empty.append(name)
        except UserError as error:
            broken.setdefault(str(error), []).append(name)
    sentences = [f"Not drawn ({listed(names)}): {reason}" for reason, names in broken.items()]
    if empty:
        sentences.append(f"Not drawn, for want of trials at the {tier} tier: {listed(empty)}.")
    return tuple(drawn), tuple(sentences)
