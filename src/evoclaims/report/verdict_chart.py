"""Verdicts as a chart: a row a claim, a column an environment or a date, and a mark in the colour of each verdict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from html import escape
from typing import Final

from evoclaims.core.printable import printable
from evoclaims.judging.verdict import Outcome

ROW, FLAT_ROW, COLUMN, LEFT, TOP, KEY = 56, 22, 150, 220, 58, 145
"""Sizes in units: height of a row, also where all marks are on its line, width of a column, room left of and above the
marks, width of a part of the key."""

LEVEL: Final = 0.5
"""The height of a mark on its line."""

GREY: Final = "#616161"
_COLOURS: Final = {
    Outcome.SUPPORTED: "#2e7d32",
    Outcome.REFUTED: "#c62828",
    Outcome.SMALLER: "#a04000",
    Outcome.INCONCLUSIVE: "#1565c0",
    Outcome.ERROR: "#000000",
    Outcome.NOT_RUN: GREY,
}


@dataclass(frozen=True)
class VerdictMark:
    """One verdict, or the lack of one.

    Attributes:
        outcome: of the verdict; None for a cross.
        tooltip: text shown when the pointer is over the mark.
        height: from 0 to 1; 0.5 is on the line.
        ringed: whether there is a ring around it.
    """

    outcome: Outcome | None
    tooltip: str
    height: float = LEVEL
    ringed: bool = False


@dataclass(frozen=True)
class VerdictChart:
    """What a chart shows.

    Attributes:
        title: of the picture.
        note: what heights and rings mean, on top.
        columns: headings by the names of columns, shown as tooltips.
        rows: by claim, the mark in each column that has one.
    """

    title: str
    note: str
    columns: Mapping[str, str]
    rows: Mapping[str, Mapping[str, VerdictMark]]

    @property
    def row(self) -> int:
        """The height of its rows."""
        flat = all(mark.height == LEVEL for marks in self.rows.values() for mark in marks.values())
        return FLAT_ROW if flat else ROW


def svg(chart: VerdictChart) -> str:
    """Return the chart as SVG."""
    width = LEFT + max(COLUMN * len(chart.columns), KEY * len(Outcome))
    height = TOP + chart.row * len(chart.rows) + 10
    drawn = "\n".join(_pieces(chart, width))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" role="img" '
        f'font-family="Verdana,DejaVu Sans,sans-serif" font-size="11">\n<title>{_text(chart.title)}</title>\n'
        f'<rect width="{width}" height="{height}" fill="#fff"/>\n{drawn}\n</svg>\n'
    )


def _pieces(chart: VerdictChart, width: int) -> Iterator[str]:
    """Yield key, headings and rows."""
    for place, outcome in enumerate(Outcome):
        at = LEFT + KEY * place + 10
        yield f'<circle cx="{at}" cy="14" r="5" fill="{_COLOURS[outcome]}"/><text x="{at + 9}" y="18">{outcome}</text>'
    yield f'<text x="8" y="18">{_text(chart.note)}</text>'
    for column, (name, heading) in enumerate(chart.columns.items()):
        title = f"<title>{_text(name)}</title>"
        for line, text in enumerate(heading.split(", ", 1)):
            yield f'<text x="{_x(column)}" y="{TOP - 20 + 12 * line}" text-anchor="middle">{_text(text)}{title}</text>'
    for row, (claim, marks) in enumerate(chart.rows.items()):
        middle = TOP + chart.row * (row + 0.5)
        yield f'<line x1="{LEFT}" x2="{width}" y1="{middle:g}" y2="{middle:g}" stroke="#bdbdbd"/>'
        yield f'<text x="8" y="{middle + 4:g}">{_text(claim)}</text>'
        yield from (
            _drawn(marks[name], _x(column), middle) for column, name in enumerate(chart.columns) if name in marks
        )


def _drawn(mark: VerdictMark, x: float, middle: float) -> str:
    """Return a mark in the column around `x` and the row around `middle`."""
    title = f"<title>{_text(mark.tooltip)}</title>"
    if mark.outcome is None:
        return f'<path d="M{x - 4:g} {middle - 4:g}l8 8m0-8l-8 8" stroke="{GREY}">{title}</path>'
    y = middle + (LEVEL - mark.height) * (ROW - 16)
    ring = f'<circle cx="{x:g}" cy="{y:g}" r="8" fill="none" stroke="#000"/>' if mark.ringed else ""
    return f'{ring}<circle cx="{x:g}" cy="{y:g}" r="5" fill="{_COLOURS[mark.outcome]}">{title}</circle>'


def _x(column: int) -> float:
    """Return the middle of a column."""
    return LEFT + COLUMN * (column + 0.5)


def _text(text: str) -> str:
    return escape(printable(" ".join(text.split())))
