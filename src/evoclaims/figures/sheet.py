"""The page of a figure (heading, legend, panels, notes; sizes in inches, so that all fits), and how figures look.

Matplotlib's constrained layout divides a page of a given height among panels, and cannot wrap text into lines; here the
page is as high as its contents.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

from evoclaims.core.drawing import Format, optional, own_style, saved
from evoclaims.figures.figure import Drawing, Heading

BLUE, SKY, GREEN, ORANGE, VERMILION, PURPLE, YELLOW = (
    "#0072b2",
    "#56b4e9",
    "#009e73",
    "#e69f00",
    "#d55e00",
    "#cc79a7",
    "#f0e442",
)
"""The palette of Okabe and Ito (2008), which readers with any colour vision can tell apart."""
INK, FAINT = "#222222", "#5f5f5f"
TITLE, TEXT, SMALL = 8.5, 7.0, 6.5
"""Sizes of letters, pt."""
COLUMN: Final = 3.5
"""Width of a column of a page, inches: the default width of a figure."""
_SETTINGS: Final[dict[str, Any]] = {
    "text.parse_math": False,  # dollar signs are plain text
    "font.size": TEXT,
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": TEXT,
    "axes.labelsize": TEXT,
    "axes.formatter.limits": (-9, 9),
    "xtick.labelsize": TEXT,
    "ytick.labelsize": TEXT,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "legend.fontsize": TEXT,
    "hatch.linewidth": 0.6,
}


def plain() -> AbstractContextManager[None]:
    """Draw, or write, in this module's style.

    Raises:
        UserError: when matplotlib is not installed.
    """
    return own_style(**_SETTINGS)


def lighter(colour: str) -> str:
    """Return a colour mixed with as much white."""
    channels = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return "#" + "".join(f"{round((c + 255) / 2):02x}" for c in channels)


LEFT, RIGHT, EDGE = 0.56, 0.1, 0.06
LINE: Final = 1.3 / 72
"""Height of a line of text, inches for each point of its size."""


@dataclass(frozen=True)
class PanelRow:
    """Panels side by side.

    Attributes:
        height: of the panels' frames.
        below: room for the names of ticks and of the axis.
        above: room for the panels' titles.
        right: room at each panel's right.
        columns: how many panels.
    """

    height: float
    below: float = 0.4
    above: float = 0.22
    right: float = RIGHT
    columns: int = 1

    def wide(self, width: float) -> float:
        """Return the width of a panel's frame on a page of `width` inches."""
        return width / self.columns - LEFT - self.right


def build(
    heading: Heading, width: float, rows: Sequence[PanelRow], legend: Sequence[Any], notes: Sequence[str]
) -> tuple[Any, list[Any]]:
    """Return a figure and the axes of its panels, row by row.

    Args:
        heading: written above.
        width: of the whole.
        rows: of panels; without any, only the notes have axes.
        legend: handles with labels, for the line below the heading.
        notes: sentences written below.
    """
    room = width - 2 * EDGE
    title, place = wrap(heading.title, room, TITLE, bold=True), wrap(heading.place, room, SMALL)
    lines = [line for note in notes for line in wrap(note, room, SMALL)]
    columns = _columns(legend, room)
    lines_of_legend = -(-len(legend) // columns) if legend else 0
    head = EDGE + len(title) * TITLE * LINE + len(place) * SMALL * LINE + 0.04
    key = lines_of_legend * (TEXT * LINE + 0.02)
    body = sum(row.above + row.height + row.below for row in rows)
    height = head + key + body + len(lines) * SMALL * LINE + EDGE
    figure = optional("matplotlib.figure").Figure(figsize=(width, height), facecolor="white")
    _write(figure, title, EDGE, EDGE, TITLE, fontweight="bold")
    _write(figure, place, EDGE, EDGE + len(title) * TITLE * LINE, SMALL, color=FAINT)
    if legend:
        figure.legend(
            handles=list(legend),
            loc="upper left",
            bbox_to_anchor=(EDGE / width, 1 - head / height),
            ncols=columns,
            frameon=False,
            borderpad=0,
            borderaxespad=0,
            handlelength=1.4,
            handletextpad=0.5,
            columnspacing=1.2,
            labelspacing=0.3,
        )
    axes, top = [], head + key
    for row in rows:
        axes += _frames(figure, row, top)
        top += row.above + row.height + row.below
    _write(figure, lines, EDGE, top, SMALL)
    return figure, axes


@lru_cache(maxsize=4096)
def measured(text: str, size: float, bold: bool = False) -> float:
    """Return the width of a line of text, inches."""
    font = optional("matplotlib.font_manager").FontProperties(size=size, weight="bold" if bold else "normal")
    width: float = optional("matplotlib.textpath").text_to_path.get_text_width_height_descent(text, font, False)[0]
    return width / 72


def wrap(text: str, width: float, size: float, *, bold: bool = False) -> list[str]:
    """Break a text at its spaces into lines of at most `width` inches; a longer word has a line of its own."""
    room = 0.98 * width  # renderers round the widths of letters
    lines: list[str] = []
    for word in text.split(" "):
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and measured(longer, size, bold) <= room:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def _frames(figure: Any, row: PanelRow, top: float) -> list[Any]:
    """Add a row's axes, `top` inches below the page's upper edge."""
    width, height = figure.get_size_inches()
    bottom, wide = height - top - row.above - row.height, row.wide(width)
    lefts = [LEFT + i * width / row.columns for i in range(row.columns)]
    return [figure.add_axes((left / width, bottom / height, wide / width, row.height / height)) for left in lefts]


def _columns(legend: Sequence[Any], room: float) -> int:
    """Return into how many columns the legend's entries fit."""
    widths = [measured(handle.get_label(), TEXT) + 0.36 for handle in legend]
    fitting = (n for n in range(len(legend), 1, -1) if sum(max(widths[i::n]) for i in range(n)) <= room)
    return next(fitting, 1)


def _write(figure: Any, lines: Sequence[str], left: float, top: float, size: float, **style: Any) -> None:
    width, height = figure.get_size_inches()
    for number, line in enumerate(lines):
        y = 1 - (top + number * size * LINE) / height
        figure.text(left / width, y, line, fontsize=size, va="top", ha="left", **style)


DOTS_PER_INCH = 220


def svg(drawing: Drawing) -> str:
    """Return the drawing as the text of an SVG file; words in it are text, and escaped."""
    return _picture(drawing, "svg").decode()


def contents(drawing: Drawing) -> dict[str, bytes]:
    """Return the contents of the drawing's files by their endings: pictures, on white, and every number drawn."""
    table: str = drawing.table.to_csv(index=False, lineterminator="\n")
    return {"png": _picture(drawing, "png"), "svg": _picture(drawing, "svg"), "csv": table.encode()}


def _picture(drawing: Drawing, file_format: Format) -> bytes:
    with plain():
        return saved(drawing.figure, file_format, drawing.title, dpi=DOTS_PER_INCH)
