"""Tables of settings: those of conditions at each tier, beside those that the paper has published."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from evoclaims.core.errors import UserError
from evoclaims.figures import sheet
from evoclaims.figures.figure import Drawing, Heading, Scope
from evoclaims.figures.sheet import FAINT, INK, SMALL, TEXT, plain
from evoclaims.paper.reported import Published
from evoclaims.trials.spec import Condition

STEP: Final = 0.145
"""Height of a line, inches."""
NAMES: Final = 0.3
"""Share of the width that the settings' names take."""
DIFFERS, SILENT = "≠", "–"


@dataclass(frozen=True)
class Block:
    """The settings of one method.

    Attributes:
        title: above them.
        method, task: the condition that they are read from.
        published: name of the paper's table.
        settings: how each is read from the condition, by its name in the paper.
    """

    title: str
    method: str
    task: str
    published: str
    settings: Mapping[str, Callable[[Condition], Any]]


@dataclass(frozen=True)
class Setting:
    """A setting: its name, what the paper says (empty for nothing), and what each tier is run with."""

    name: str
    paper: str
    ours: tuple[str, ...]

    @property
    def cells(self) -> tuple[str, ...]:
        """The texts of the columns."""
        marked = [f"{value} {DIFFERS}" if self.paper and value != self.paper else value for value in self.ours]
        return (self.name, self.paper or SILENT, *marked)


@dataclass(frozen=True)
class Listing:
    """All blocks, one below the other.

    Attributes:
        blocks: the methods' settings.
        published: the paper's tables.
        remarks: sentences below.
        width: of the figure, inches.
    """

    blocks: tuple[Block, ...]
    published: Published
    remarks: tuple[str, ...] = ()
    width: float = 7.0

    def __call__(self, scope: Scope, heading: Heading) -> Drawing:
        """Draw the table; it needs no trials."""
        import pandas as pd

        tiers = [scope.tier_name, *(name for name in scope.reproduction.tiers if name != scope.tier_name)]
        settings = [self._settings(scope, block, tiers) for block in self.blocks]
        caption = (f"{DIFFERS}: not the paper's value; {SILENT}: the paper gives none.", *self.remarks)
        with plain():
            page = _Page(self.width, ["paper", *tiers])
            for block, found in zip(self.blocks, settings, strict=True):
                page.block(block.title, found, self.published.table(block.published)["place"])
            figure, (axis,) = sheet.build(heading, self.width, [sheet.PanelRow(page.height, below=0.1)], [], caption)
            page.paint(axis)
        rows = [
            {"table": block.title, "setting": one.name, "paper": one.paper, **dict(zip(tiers, one.ours, strict=True))}
            for block, found in zip(self.blocks, settings, strict=True)
            for one in found
        ]
        table = pd.DataFrame(rows, columns=["table", "setting", "paper", *tiers])
        return Drawing(figure, table, caption, (), len(rows), f"{heading.title} ({heading.place})")

    def _settings(self, scope: Scope, block: Block, tiers: Sequence[str]) -> list[Setting]:
        values = self.published.table(block.published)["values"]
        if not set(values) <= set(block.settings):
            raise UserError(
                f"The table {block.title!r} leaves out what the paper has published: "
                f"{', '.join(sorted(set(values) - set(block.settings)))}."
            )
        conditions = [scope.reproduction.tier(name).condition(block.method, block.task) for name in tiers]
        return [
            Setting(name, _text(values.get(name, "")), tuple(_text(get(condition)) for condition in conditions))
            for name, get in block.settings.items()
        ]


class _Page:
    """Lines of cells, laid out from the top; heights in inches."""

    def __init__(self, width: float, headings: Sequence[str]) -> None:
        self.height = 0.0
        self._room = width - 2 * sheet.EDGE
        share = (1 - NAMES) / len(headings)
        self._lefts = [0.0, *(self._room * (NAMES + i * share) for i in range(len(headings)))]
        self._widths = [NAMES * self._room, *[share * self._room] * len(headings)]
        self._headings = headings
        self._words: list[tuple[float, float, str, dict[str, Any]]] = []
        self._rules: list[float] = []

    def block(self, title: str, settings: Sequence[Setting], place: str) -> None:
        """Add a block: its title with the names of the columns, its settings, and the place in the paper."""
        self._line((title,), fontweight="bold")
        self.height -= STEP
        self._line(("", *self._headings), color=FAINT)
        self._rules.append(self.height)
        for setting in settings:
            self._line(setting.cells)
        self._words.append((0.0, self.height, f"paper: {place}", {"fontsize": SMALL, "color": FAINT}))
        self.height += 1.7 * STEP

    def paint(self, axis: Any) -> None:
        """Paint everything; the axes are stretched over the page's width."""
        box, page = axis.get_position(), axis.figure.get_figwidth()
        axis.set_position((sheet.EDGE / page, box.y0, self._room / page, box.height))
        axis.set(xlim=(0.0, self._room), ylim=(self.height, 0.0))
        axis.set_axis_off()
        for rule in self._rules:
            axis.plot([0.0, self._room], [rule, rule], color=INK, linewidth=0.6, clip_on=False)
        for left, top, word, style in self._words:
            axis.text(left, top + STEP / 2, word, va="center", **style)

    def _line(self, cells: Sequence[str], **style: Any) -> None:
        """Add a line, as high as its longest cell when wrapped to its column."""
        bold = "fontweight" in style
        columns = zip(cells, self._widths, strict=False)
        broken = [sheet.wrap(cell, width - 0.1, TEXT, bold=bold) for cell, width in columns]
        for left, words in zip(self._lefts, broken, strict=False):
            for i, word in enumerate(words):
                self._words.append((left, self.height + i * STEP, word, {"fontsize": TEXT, **style}))
        self.height += max(map(len, broken)) * STEP


def _text(value: Any) -> str:
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:g}" if isinstance(value, float) else str(value)
