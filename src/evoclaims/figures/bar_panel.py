"""One panel of a bar chart: a dot per trial, published numbers beside; missing trials are named, never drawn as 0."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from evoclaims.core.drawing import optional
from evoclaims.figures import brackets
from evoclaims.figures.brackets import PairTest
from evoclaims.figures.sheet import FAINT, INK, SMALL, TEXT, PanelRow, lighter, measured
from evoclaims.figures.trial_numbers import NOT_RUN, MeasureOf, TrialNumbers
from evoclaims.paper.reported import Reported

GAP: Final = 0.7
"""Room between groups of bars, in slots."""
BASE, BRACKET = 1.25, 7.5 / 72
"""Height of the numbers' range and of a bracket, inches."""
ASIDE: Final = 0.14
"""How far a bar is moved from the middle of its slot, to make room for a published number."""
UNDER: Final = 0.03
"""Margin below and above the range, as a share of it."""


@dataclass(frozen=True)
class Series:
    """A method, as figures show it.

    Attributes:
        method: its name in conditions.
        label: its name in figures.
        colour: of its bars, as matplotlib takes it.
    """

    method: str
    label: str
    colour: str


@dataclass(frozen=True)
class Bar:
    """One bar.

    Attributes:
        at: name of its place on the axis; bars of one place stand side by side.
        series: the method.
        task: name of the task.
        measure: what is measured.
        reported: the published number.
    """

    at: str
    series: Series
    task: str
    measure: MeasureOf
    reported: Reported | None = None


@dataclass(frozen=True)
class BarPanel:
    """A panel of bars.

    Attributes:
        title: above it.
        bars: in the order of the axis.
        ylabel, xlabel: of the axes.
        limits: the least range of the axis; larger numbers extend it.
        across: whether each method is compared with itself between places.
        beside: whether published numbers are drawn; else they are only listed.
    """

    title: str
    bars: tuple[Bar, ...]
    ylabel: str
    xlabel: str = ""
    limits: tuple[float, float] | None = None
    across: bool = False
    beside: bool = True


@dataclass(frozen=True)
class Filled:
    """A bar with its numbers."""

    bar: Bar
    numbers: TrialNumbers

    @property
    def reported(self) -> Reported | None:
        """The published number."""
        return self.bar.reported


@dataclass(frozen=True)
class Measured:
    """A panel with its numbers and comparisons."""

    panel: BarPanel
    bars: tuple[Filled, ...]
    comparisons: tuple[PairTest, ...]

    @property
    def shows_reported(self) -> bool:
        """Whether a published number is drawn."""
        return self.panel.beside and any(bar.reported for bar in self.bars)

    @property
    def grouped(self) -> bool:
        """Whether places have names; else bars are named by their methods."""
        return any(bar.bar.at for bar in self.bars)


@dataclass(frozen=True)
class Layout:
    """The positions of a panel's parts.

    Attributes:
        measured: the panel.
        row: its room on the page.
        slots: the middle of each bar's slot, which is 1 wide.
        bars: the middle of each bar.
        limits: of the vertical axis.
        bracket: height of a bracket, in the axis' units.
        brackets: for each bracket its comparison, and its height.
        slanted: whether axis labels are slanted.
    """

    measured: Measured
    row: PanelRow
    slots: tuple[float, ...]
    bars: tuple[float, ...]
    limits: tuple[float, float]
    bracket: float
    brackets: tuple[tuple[PairTest, float], ...]
    slanted: bool


def lay_out(one: Measured, width: float) -> Layout:
    """Lay a panel out on a frame of `width` inches: its height grows with the number of brackets."""
    slots, at = [], 0.0
    for i, bar in enumerate(one.bars):
        at += GAP if i and bar.bar.at != one.bars[i - 1].bar.at else 0.0
        slots.append(at)
        at += 1.0
    bars = [slot - ASIDE * one.shows_reported for slot in slots]
    feet, tops = zip(*(_ends(bar, one) for bar in one.bars), strict=True)
    low = min([0.0, *(one.panel.limits or ()), *feet])
    high = max([*(one.panel.limits or ()), *tops])
    high = high if high > low else low + 1.0  # nothing has run
    span = high - low
    bracket = span * BRACKET / BASE
    stars = [comparison for comparison in one.comparisons if comparison.asterisks]
    ends = [(bars[comparison.left], bars[comparison.right]) for comparison in stars]
    spans = [(min(pair), max(pair)) for pair in ends]
    words = [1.3 * bracket * bar.numbers.incomplete for bar in one.bars]  # room for "8/10" above a bar
    below = [(place, top + more) for place, top, more in zip(bars, tops, words, strict=True)]
    heights = brackets.stack(spans, below, bracket)
    top = max([high, *(height for _, height in below), *(height + bracket for height in heights)])
    limits = (low - UNDER * span * (low < 0), top + UNDER * span)
    slot = width / (at + GAP)
    names = _names(one)
    slanted = any(measured(name, TEXT) > slot * members - 0.04 for name, members, _ in names)
    under = 0.12 + (max(measured(name, TEXT) for name, *_ in names) * 0.5 + 0.1 if slanted else 0.14)
    row = PanelRow(
        height=(limits[1] - limits[0]) / span * BASE,
        below=under + (0.16 if one.panel.xlabel else 0.0),
        above=0.24 if one.panel.title else 0.1,
    )
    placed = tuple(zip(stars, heights, strict=True))
    return Layout(one, row, tuple(slots), tuple(bars), limits, bracket, placed, slanted)


def paint(axis: Any, layout: Layout) -> None:
    """Paint a panel into its axes."""
    one = layout.measured
    axis.set(
        xlim=(-0.5 - GAP / 2, layout.slots[-1] + 0.5 + GAP / 2),
        ylim=layout.limits,
        xlabel=one.panel.xlabel,
    )
    axis.set_title(one.panel.title, loc="left", pad=5.0)
    axis.axhline(0.0, color=INK, linewidth=0.6, zorder=1)
    for bar, slot, middle in zip(one.bars, layout.slots, layout.bars, strict=True):
        _paint_bar(axis, bar, middle, 0.64 if one.shows_reported else 0.84)
        if one.shows_reported and bar.reported:
            _paint_reported(axis, bar.reported, slot + 0.34, bar.bar.series.colour)
    for comparison, height in layout.brackets:
        ends = sorted((layout.bars[comparison.left], layout.bars[comparison.right]))
        brackets.paint(axis, (ends[0], ends[1]), height, layout.bracket, comparison.asterisks)
    names = _names(one)
    middles = [sum(layout.slots[first : first + members]) / members for _, members, first in names]
    style = {"rotation": 30.0, "ha": "right", "rotation_mode": "anchor"} if layout.slanted else {}
    axis.set_xticks(middles, [name for name, *_ in names], **style)
    axis.tick_params(axis="x", length=0.0, pad=3.0)
    _number(axis, layout)


def _number(axis: Any, layout: Layout) -> None:
    """Put ticks on the vertical axis only up to the largest number: no success is 1.4, as high as the brackets."""
    one, (low, high) = layout.measured, layout.limits
    top = max([*(one.panel.limits or ()), *(_ends(bar, one)[1] for bar in one.bars)])
    locator = optional("matplotlib.ticker").MaxNLocator(5, steps=[1, 2, 5, 10])
    ticks = [tick for tick in locator.tick_values(low, top) if low <= tick <= top * (1 + 1e-9)]
    axis.set_yticks(ticks if top > low else [])
    axis.spines["left"].set_bounds(low, top if top > low else high)
    axis.set_ylabel(one.panel.ylabel, y=((top if top > low else high) - low) / (high - low) / 2)


def legend(panels: Sequence[Measured]) -> list[Any]:
    """Return the handles of a legend for panels: the methods that the axis does not name, and symbols."""
    lines, patches = optional("matplotlib.lines"), optional("matplotlib.patches")
    series = {bar.bar.series: None for one in panels if one.grouped for bar in one.bars}
    handles = [patches.Patch(facecolor=lighter(s.colour), edgecolor=s.colour, label=s.label) for s in series]
    if any(one.shows_reported for one in panels):
        handles.append(lines.Line2D([], [], label="reported by the paper", **_DIAMOND))
    if any(bar.numbers.broken for one in panels for bar in one.bars):
        handles.append(lines.Line2D([], [], label="trial without a value", **_CROSS))
    return handles


_DIAMOND: Final = {
    **{"marker": "D", "markersize": 3.6, "markerfacecolor": "white", "markeredgecolor": INK, "markeredgewidth": 0.8},
    **{"color": INK, "linestyle": "", "zorder": 5},
}
_CROSS: Final = {"marker": "x", "markersize": 4.0, "markeredgewidth": 1.0, "color": INK, "linestyle": "", "zorder": 6}


def _paint_bar(axis: Any, filled: Filled, middle: float, width: float) -> None:
    numbers, colour = filled.numbers, filled.bar.series.colour
    if numbers.values:
        style = {"facecolor": lighter(colour), "edgecolor": colour, "linewidth": 0.8, "zorder": 2}
        axis.bar(middle, numbers.mean, width, **style)
    if len(numbers.values) > 1:
        style = {"elinewidth": 0.8, "capsize": 1.8, "capthick": 0.8, "ecolor": INK, "zorder": 3}
        axis.errorbar(middle, numbers.mean, yerr=numbers.deviation, fmt="none", **style)
    places = [middle + 0.8 * width * share for share in _across(len(numbers.each))]
    pairs = list(zip(places, numbers.each, strict=True))
    dots = [(place, number.value) for place, number in pairs if number.value is not None]
    if dots:
        axis.scatter(*zip(*dots, strict=True), s=5.5, c=colour, edgecolors="white", linewidths=0.3, zorder=4)
    foot = axis.get_xaxis_transform()
    broken = [place for place, number in pairs if number.value is None and number.status != NOT_RUN]
    if broken:
        axis.plot(broken, [0.05] * len(broken), transform=foot, **_CROSS)
    words = {"ha": "center", "va": "bottom", "fontsize": SMALL, "color": FAINT}
    if not dots and not broken:
        axis.text(middle, 0.04, NOT_RUN, transform=foot, rotation=90, **words)
    elif numbers.incomplete:
        count = f"{len(dots)}/{len(pairs)}"
        top = (middle, _ends_of_data(numbers)[1])
        axis.annotate(count, top, xytext=(0, 1.5), textcoords="offset points", **words)


def _paint_reported(axis: Any, reported: Reported, place: float, colour: str) -> None:
    """Paint a published number in its method's colour."""
    style = {"elinewidth": 0.7, "capsize": 1.2, "ecolor": colour, "clip_on": False, **_DIAMOND}
    style |= {"markeredgecolor": colour, "markeredgewidth": 1.0}
    axis.errorbar(place, reported.value, yerr=reported.error or None, **style)


def _across(count: int) -> list[float]:
    """Return each seed's position across its bar, from -0.5 to 0.5; it is the same in all bars."""
    return [0.0] if count == 1 else [i / (count - 1) - 0.5 for i in range(count)]


def _names(one: Measured) -> list[tuple[str, int, int]]:
    """Return the names below the axis, the number of bars of each, and the first of them."""
    if not one.grouped:
        return [(bar.bar.series.label, 1, i) for i, bar in enumerate(one.bars)]
    names: list[tuple[str, int, int]] = []
    for i, bar in enumerate(one.bars):
        if names and names[-1][0] == bar.bar.at:
            names[-1] = (bar.bar.at, names[-1][1] + 1, names[-1][2])
        else:
            names.append((bar.bar.at, 1, i))
    return names


def _ends_of_data(numbers: TrialNumbers) -> tuple[float, float]:
    """Return the lower and upper end of a bar, which begins at 0, with its dots and error bar."""
    deviation = numbers.deviation if len(numbers.values) > 1 else 0.0
    bar = [numbers.mean - deviation, numbers.mean + deviation] if numbers.values else []
    ends = [0.0, *bar, *numbers.values]
    return min(ends), max(ends)


def _ends(bar: Filled, one: Measured) -> tuple[float, float]:
    """Return the lower and upper end of all that is drawn at a bar."""
    low, high = _ends_of_data(bar.numbers)
    if bar.reported is None or not one.panel.beside:
        return low, high
    error = bar.reported.error or 0.0
    return min(low, bar.reported.value - error), max(high, bar.reported.value + error)
