"""The paper's figures, redrawn for a report."""

from __future__ import annotations

from evoclaims.core.errors import UserError
from evoclaims.figures import catalogue, files
from evoclaims.paper.archive import Archive
from evoclaims.paper.reproduction import Reproduction
from evoclaims.report.formatting import clean, listed
from evoclaims.report.model import Plate


def plates(reproduction: Reproduction, archive: Archive, tier: str) -> tuple[tuple[Plate, ...], tuple[str, ...]]:
    """Return the figures of which there is something to draw at a tier, and sentences about the others."""
    drawn: list[Plate] = []
    empty: list[str] = []
    broken: dict[str, list[str]] = {}
    for name in catalogue.names(reproduction):
        try:
            drawing = catalogue.load(reproduction, name).draw(archive, reproduction, tier)
            if drawing.shown:
                says = clean(" ".join((*drawing.caption, *drawing.missing)))
                drawn.append(Plate(clean(drawing.title), says, files.svg(drawing).encode()))
            else:
                empty.append(name)
        except UserError as error:
            broken.setdefault(clean(error), []).append(name)
    sentences = [f"Not drawn ({listed(names)}): {reason}" for reason, names in broken.items()]
    if empty:
        sentences.append(f"Not drawn, for want of trials at the {tier} tier: {listed(empty)}.")
    return tuple(drawn), tuple(sentences)
