"""Bar charts: what is compared, and where on the axis; `bar_panel` paints them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from evoclaims.figures import bar_panel, brackets, sheet
from evoclaims.figures.bar_panel import Bar, BarPanel, Filled, Measured, Series
from evoclaims.figures.figure import Drawing, Heading, Scope
from evoclaims.figures.sheet import COLUMN, plain
from evoclaims.figures.trial_numbers import MeasureOf, absences, frame, read
from evoclaims.paper.reported import Published

PanelOf = Callable[[Scope], BarPanel]

HOW = (
    "Bars: mean of the trials; error bars: their standard deviation; dots: trials, each seed at one place across bars."
)
"""How to read bars."""


@dataclass(frozen=True)
class BarChart:
    """Panels of bars, one below the other.

    Attributes:
        panels: each made for the tier that is drawn.
        width: of the figure, inches.
        remarks: further sentences below it.
    """

    panels: tuple[PanelOf, ...]
    width: float = COLUMN
    remarks: tuple[str, ...] = ()

    def __call__(self, scope: Scope, heading: Heading) -> Drawing:
        """Draw the panels from a tier's trials."""
        panels = [made(scope) for made in self.panels]
        measured = [_measured(scope, panel) for panel in panels]
        with plain():
            layouts = [bar_panel.lay_out(one, self.width - sheet.LEFT - sheet.RIGHT) for one in measured]
            caption, missing = self._caption(measured), absences(bar.numbers for one in measured for bar in one.bars)
            rows = [layout.row for layout in layouts]
            legend = bar_panel.legend(measured)
            figure, axes = sheet.build(heading, self.width, rows, legend, [*missing, *caption])
            for axis, layout in zip(axes, layouts, strict=True):
                bar_panel.paint(axis, layout)
        table = frame(row for one in measured for row in _rows(one))
        shown = sum(len(bar.numbers.values) for one in measured for bar in one.bars)
        return Drawing(figure, table, caption, missing, shown, f"{heading.title} ({heading.place})")

    def _caption(self, measured: Sequence[Measured]) -> tuple[str, ...]:
        """Say how to read the figure, and where the paper has the published numbers."""
        shown = [one for one in measured for bar in one.bars if bar.numbers.values]
        sentences = [HOW] if shown else []
        if any(one.comparisons for one in measured):
            found = any(comparison.asterisks for one in measured for comparison in one.comparisons)
            sentences.append(brackets.EXPLAINED if found else f"{brackets.EXPLAINED} No pair differs so.")
        reported = {bar.reported.place: None for one in measured for bar in one.bars if bar.reported}
        if reported:
            sentences.append(f"Reported: {'; '.join(reported)}.")
        elsewhere = [text for one in measured if not one.panel.beside for text in _told(one)]
        if elsewhere:
            sentences.append(f"Reported, on another scale: {', '.join(elsewhere)}.")
        return (*sentences, *self.remarks)


def by_level(task: str, title: str, series: Sequence[Series], published: Published) -> PanelOf:
    """Return a panel of the success on each level of a task, one bar per method, beside the published "success"."""

    def made(scope: Scope) -> BarPanel:
        levels = scope.tier.condition(series[0].method, task).task.levels
        bars = tuple(
            Bar(str(k), one, task, partial(_success_at, k), published.value(task, "success", one.method, k))
            for k in range(levels)
            for one in series
        )
        return BarPanel(title, bars, "success", "level", limits=(0.0, 1.0))

    return made


def compared(
    quantity: str,
    measure: MeasureOf,
    series: Sequence[Series],
    places: Mapping[str, str],
    published: Published,
    *,
    title: str = "",
    ylabel: str,
    limits: tuple[float, float] | None = None,
    comparable: Sequence[str] = ("full", "smoke"),
) -> PanelOf:
    """Return a panel of one measure, with one bar per method at each place on the axis.

    Methods are compared with each other at each place, and each with itself between places.

    Args:
        quantity: the measure's name among the published numbers.
        measure: what is measured.
        series: the methods.
        places: tasks, by their names on the axis.
        published: published numbers.
        title: of the panel.
        ylabel: the measure's name and unit.
        limits: what the axis shows at least.
        comparable: tiers at which the published numbers are drawn; at others they are listed below.
    """

    def made(scope: Scope) -> BarPanel:
        bars = tuple(
            Bar(place, one, task, measure, published.value(task, quantity, one.method))
            for place, task in places.items()
            for one in series
        )
        return BarPanel(title, bars, ylabel, limits=limits, beside=scope.tier_name in comparable, across=True)

    return made


def _success_at(level: int, group: Any) -> Any:
    return group.mean_success if group.condition.task.levels == 1 else group.success.at(level)


def _measured(scope: Scope, panel: BarPanel) -> Measured:
    """Read a panel's trials, and compare them as the paper does."""
    numbers = [read(scope, bar.series.method, bar.task, bar.measure) for bar in panel.bars]
    families = [*_families(bar.at for bar in panel.bars)]
    if panel.across:
        families += _families(bar.series.label for bar in panel.bars)
    comparisons = brackets.compare([one.ranks for one in numbers], families)
    return Measured(panel, tuple(map(Filled, panel.bars, numbers)), comparisons)


def _families(names: Iterable[str]) -> list[list[int]]:
    """Return the indices of equal names, in order of first appearance."""
    found: dict[str, list[int]] = {}
    for i, name in enumerate(names):
        found.setdefault(name, []).append(i)
    return [members for members in found.values() if len(members) > 1]


def _told(measured: Measured) -> list[str]:
    return [
        f"{bar.bar.series.label} {bar.reported.value:g}" + (f" ± {bar.reported.error:g}" if bar.reported.error else "")
        for bar in measured.bars
        if bar.reported
    ]


def _rows(measured: Measured) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for bar in measured.bars:
        rows += bar.numbers.rows(**_place(measured, bar.bar))
        if bar.reported:
            error = math.nan if bar.reported.error is None else bar.reported.error
            common = {**_place(measured, bar.bar), "method": bar.numbers.method, "task": bar.numbers.task}
            rows.append({**common, "what": "reported", "value": bar.reported.value, "error": error})
    for comparison in measured.comparisons:
        left, right = measured.bars[comparison.left].bar, measured.bars[comparison.right].bar
        against = " ".join(filter(None, (right.series.label, right.at)))
        rows.append({**_place(measured, left), "what": "Mann-Whitney U", "against": against, "value": comparison.p})
    overall = {comparison.family: comparison.overall for comparison in measured.comparisons}
    for family, p in overall.items():
        places = [_place(measured, measured.bars[i].bar) for i in family]
        shared = {name: value for name, value in places[0].items() if all(place[name] == value for place in places)}
        rows.append({**shared, "what": "Kruskal-Wallis", "value": p})
    return rows


def _place(measured: Measured, bar: Bar) -> dict[str, str]:
    return {"panel": measured.panel.title, "at": bar.at, "series": bar.series.label}
