"""Tables and other rich content as text: control characters in it are escaped, rich's colours are kept.

Rich itself drops five control characters and lets all others through, including the one that begins commands.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import Any, Final

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType
from rich.measure import Measurement
from rich.segment import Segment
from rich.table import Table

from evoclaims.core.printable import shown, spelled

GAP: Final = 2
"""Columns of the terminal between those of a table."""

_USUAL: Final = 80
"""Columns of a terminal that does not say how many it has."""

_WIDEST: Final = 10_000
"""More columns of a terminal than any table needs."""


class PlainSpokenConsole(Console):
    """A console that escapes control characters in all content, after its layout, and reads no markup in it."""

    def __init__(self, **settings: Any) -> None:
        """Show texts as they are."""
        super().__init__(emoji=False, markup=False, highlight=False, **settings)
        self.width = self.width or _USUAL  # COLUMNS=0, of a terminal that knows no size: rich would print nothing

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield the pieces that content is made of, each safe to print."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=shown(segment.text))

    def print_whole(self, table: Table) -> None:
        """Print a table of texts without cutting one: where the terminal is too narrow for it, lines are longer.

        A column that may be broken needs room for its longest word, another for its longest line.
        """
        columns = [(column.no_wrap, map(str, (column.header, *column.cells))) for column in table.columns]
        needed = sum(max(cell_len(part) for text in texts for part in _parts(text, whole)) for whole, texts in columns)
        if needed + GAP * (len(columns) - 1) > self.width:
            table.width = Measurement.get(self, self.options.update(max_width=_WIDEST), table).maximum
        self.print(table, crop=False)


def _parts(text: str, whole: bool) -> list[str]:
    """Return the parts of a cell that stay together: its lines, or its words."""
    return (text.splitlines() if whole else text.split()) or [""]


class SpelledTable(Table):
    """A table whose texts are spelled in the characters of standard output before they are laid out."""

    def add_column(self, header: RenderableType = "", *rest: Any, **settings: Any) -> None:
        """Add a column."""
        super().add_column(_spelled(header), *rest, **settings)

    def add_row(self, *cells: RenderableType | None, **settings: Any) -> None:
        """Add a row."""
        super().add_row(*map(_spelled, cells), **settings)


def _spelled(cell: Any) -> Any:
    """Return a cell; a text in characters that standard output has."""
    return spelled(cell, getattr(sys.stdout, "encoding", None)) if isinstance(cell, str) else cell


def plain_table(headings: Sequence[str], rows: Iterable[Sequence[str]], names: int = 1) -> Table:
    """Return a table without lines; the first columns hold `names`, which alone are broken on a narrow terminal."""
    made = SpelledTable(box=None, pad_edge=False)
    for place, heading in enumerate(headings):
        name = place < names
        made.add_column(heading, justify="left" if name else "right", no_wrap=not name, overflow="fold")
    for row in rows:
        made.add_row(*row)
    return made
