"""Histograms of a measure of trials, one panel per condition, with a shared axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from evoclaims.core.drawing import optional
from evoclaims.figures import sheet
from evoclaims.figures.bar_panel import Series
from evoclaims.figures.figure import Drawing, Heading, Scope
from evoclaims.figures.sheet import COLUMN, FAINT, SMALL, VERMILION, lighter, plain
from evoclaims.figures.trial_numbers import NOT_RUN, MeasureOf, TrialNumbers, absences, frame, read

BINS: Final = 24
HEIGHT: Final = 0.85
"""Height of a panel, inches."""


@dataclass(frozen=True)
class HistogramPanel:
    """Whose trials a panel shows.

    Attributes:
        title: of the panel.
        series: the method.
        task: name of the task.
    """

    title: str
    series: Series
    task: str


@dataclass(frozen=True)
class Threshold:
    """A value that the axis marks, and what it means."""

    value: float
    label: str


@dataclass(frozen=True)
class Histogram:
    """Panels one below the other, with shared bins.

    Attributes:
        conditions: one per panel.
        measure: what is counted.
        xlabel: its name and unit.
        mark: a value to compare with.
        remarks: sentences below.
        width: of the figure, inches.
    """

    conditions: tuple[HistogramPanel, ...]
    measure: MeasureOf
    xlabel: str
    mark: Threshold
    remarks: tuple[str, ...] = ()
    width: float = COLUMN

    def __call__(self, scope: Scope, heading: Heading) -> Drawing:
        """Draw the panels from a tier's trials."""
        read_all = [read(scope, one.series.method, one.task, self.measure) for one in self.conditions]
        values = [value for numbers in read_all for value in numbers.values]
        # Where every trial has the same value, bins still have a width.
        low, high = min([0.0, *values]), max([self.mark.value, *values])
        margin = 0.04 * ((high - low) or 1.0)
        edges = np.linspace(low - margin, high + margin, BINS + 1)
        counts = [np.histogram(numbers.values, edges)[0] for numbers in read_all]
        most = max([1, *(int(count.max()) for count in counts)])
        missing = absences(read_all)
        with plain():
            last = len(self.conditions) - 1
            rows = [sheet.PanelRow(HEIGHT, below=0.44 if i == last else 0.18) for i in range(last + 1)]
            legend = [optional("matplotlib.lines").Line2D([], [], label=self.mark.label, **_LINE)]
            figure, axes = sheet.build(heading, self.width, rows, legend, [*missing, *self.remarks])
            for axis, one, numbers, count in zip(axes, self.conditions, read_all, counts, strict=True):
                self._paint(axis, one, numbers, edges, count)
                axis.set(xlim=(edges[0], edges[-1]), ylim=(0, 1.22 * most), ylabel="trials")
                axis.yaxis.set_major_locator(optional("matplotlib.ticker").MaxNLocator(3, integer=True))
            axes[-1].set_xlabel(self.xlabel)
        table = frame(
            row
            for one, numbers in zip(self.conditions, read_all, strict=True)
            for row in numbers.rows(panel=one.title, at="", series=one.series.label)
        )
        return Drawing(figure, table, self.remarks, missing, len(values), f"{heading.title} ({heading.place})")

    def _paint(self, axis: Any, one: HistogramPanel, numbers: TrialNumbers, edges: Any, counts: Any) -> None:
        """Paint one panel: counts, every trial as a dot above its bin, and the mark."""
        colour = one.series.colour
        style = {"facecolor": lighter(colour), "edgecolor": colour, "linewidth": 0.7, "align": "edge"}
        axis.bar(edges[:-1], counts, np.diff(edges), zorder=2, **style)
        axis.axvline(self.mark.value, zorder=3, **_LINE)
        heights: dict[int, int] = {}
        for value in sorted(numbers.values):
            i = int(np.clip(np.searchsorted(edges, value, side="right") - 1, 0, len(edges) - 2))
            heights[i] = heights.get(i, 0) + 1
            axis.plot([value], [heights[i] - 0.5], "o", ms=2.4, color=colour, mec="white", mew=0.3, zorder=4)
        count = f" ({len(numbers.values)} of {len(numbers.each)} trials)"
        axis.set_title(one.title + (count if len(numbers.values) < len(numbers.each) else ""), loc="left", pad=4.0)
        if not numbers.values:
            word = "no values" if numbers.broken else NOT_RUN
            axis.text(0.5, 0.5, word, transform=axis.transAxes, ha="center", fontsize=SMALL, color=FAINT)


_LINE: Final = {"color": VERMILION, "linestyle": (0, (4, 2)), "linewidth": 1.0}
