"""Claims by environments as a chart: a row a claim, a mark an environment, as high as its trials are against the first's."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from typing import Final

from evoclaims.core.printable import printable
from evoclaims.judging.verdict import Outcome
from evoclaims.report import across_table
from evoclaims.report.badge import BLUE, GREEN, GREY, RED
from evoclaims.verdicts.across import Across, Cell

ROW, COLUMN, LEFT, TOP = 56, 130, 220, 58
"""Sizes in units: height of a row, width of a column, and what is left of and above the marks."""

_COLOURS: Final = {
    Outcome.SUPPORTED: GREEN,
    Outcome.REFUTED: RED,
    Outcome.INCONCLUSIVE: BLUE,
    Outcome.ERROR: "#000000",
    Outcome.NOT_RUN: GREY,
}


def svg(found: Across) -> str:
    """Return the chart: within a row, A12 from 0 to 1; the line is 0.5, a ring is drift, a cross is no verdicts."""
    width, height = LEFT + COLUMN * len(found.environments), TOP + ROW * len(found.claims) + 10
    drawn = "\n".join(_pieces(found, width))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" role="img" '
        f'font-family="Verdana,DejaVu Sans,sans-serif" font-size="11">\n<title>{_text(across_table.headline(found))}'
        f'</title>\n<rect width="{width}" height="{height}" fill="#fff"/>\n{drawn}\n</svg>\n'
    )


def _pieces(found: Across, width: int) -> Iterator[str]:
    """Yield legend, headings, and the rows."""
    at = LEFT
    for outcome in Outcome:
        yield f'<circle cx="{at}" cy="14" r="5" fill="{_COLOURS[outcome]}"/><text x="{at + 9}" y="18">{outcome}</text>'
        at += 95
    yield '<text x="8" y="18">height: A12 against the first</text><text x="8" y="36">line: 0.5; ring: drift</text>'
    for column, one in enumerate(found.environments):
        yield f'<text x="{_x(column)}" y="{TOP - 8}" text-anchor="middle">{_text(one.label)}</text>'
    for row, claim in enumerate(found.claims):
        middle = TOP + ROW * row + ROW / 2
        yield f'<line x1="{LEFT}" x2="{width}" y1="{middle:g}" y2="{middle:g}" stroke="#bdbdbd"/>'
        yield f'<text x="8" y="{middle + 4:g}">{_text(claim)}</text>'
        for column, one in enumerate(found.environments):
            yield _mark(_x(column), middle, found.cells.get((claim, one.label)), one.trouble)


def _mark(x: float, middle: float, cell: Cell | None, trouble: str) -> str:
    """Return the mark of a claim in an environment, whose title says what the table says."""
    if cell is None:
        cross = f"M{x - 4:g} {middle - 4:g}l8 8m0-8l-8 8"
        return f'<path d="{cross}" stroke="{GREY}"><title>{_text(trouble or "no verdict")}</title></path>'
    a12 = 0.5 if cell.drift is None or cell.drift.a12 is None else cell.drift.a12
    y = middle + (0.5 - a12) * (ROW - 16)
    ring = f'<circle cx="{x:g}" cy="{y:g}" r="8" fill="none" stroke="#000"/>' if cell.drifted else ""
    said = _text("; ".join(across_table.said(cell)))
    return f'{ring}<circle cx="{x:g}" cy="{y:g}" r="5" fill="{_COLOURS[cell.outcome]}"><title>{said}</title></circle>'


def _x(column: int) -> float:
    """Return the middle of a column."""
    return LEFT + COLUMN * (column + 0.5)


def _text(text: str) -> str:
    """Return a text for SVG, on one line."""
    return escape(printable(" ".join(text.split())))
