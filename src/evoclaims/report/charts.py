"""Small SVG drawings for the page; colours come from the page's style sheet, so that light and dark both work."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from markupsafe import Markup, escape

from evoclaims.report.evidence import Part, Strip
from evoclaims.report.formatting import large, number, plural
from evoclaims.report.training_curves import CurvePanel, Line

WIDTH, HEIGHT, EDGE, APART = 340.0, 44.0, 24.0, 70.0
"""Size of a strip of dots; `APART` is the width of the column of trials without a finite value."""

AXIS: Final = 30.0
MOST: Final = 1e300
"""The largest number that an axis shows, so that differences stay finite."""

LEAST: Final = 1e-300
"""The smallest difference that ticks tell apart: below, floats run out of digits."""


DOT, BLOCK = 7.0, 44.0
"""Width of a dot, and of the widest block of close values, which fits into the edges."""

PANEL, LEFT, RIGHT, TOP, BOTTOM = (240.0, 132.0), 34.0, 8.0, 8.0, 20.0
"""Size and margins of a panel of curves."""


def part_scale(part: Part) -> tuple[float, float]:
    """Return the ends of the axis that all strips of a part share: everything drawn lies between them."""
    if part.event:
        return 0.0, 1.0
    values = [dot.value for strip in part.strips for dot in strip.dots] + [bound.value for bound in part.bounds]
    if not values:
        return 0.0, 1.0
    low, high = _shown(min(values)), _shown(max(values))
    if low >= 0 and high <= 1:
        return 0.0, 1.0
    room = 0.03 * (high - low) or 0.5
    return low - room, high + room


def strip_svg(part: Part, strip: Strip) -> Markup:
    """Draw a strip: a dot per trial, the median, what the assertion compares with, and broken trials apart."""
    scale = _Scale(*part_scale(part), right=_right(part))
    pieces: list[Markup] = [Markup('<path class="rule" d="M{} {}H{}"/>').format(EDGE, HEIGHT - 1, scale.right)]
    for bound in part.bounds:
        pieces.append(
            _mark("bound", f"M{_at(scale(bound.value))} 1V{HEIGHT - 1}", f"{bound.name}: {number(bound.value)}")
        )
    for span in part.spans:
        path = f"M{_at(scale(span.low))} {HEIGHT - 4}H{_at(scale(span.high))}"
        pieces.append(_mark("span", path, f"{span.of}: {number(span.low)} to {number(span.high)}"))
    if part.event and strip.n:
        share = sum(dot.value for dot in strip.dots) / strip.n
        diamond = f"M{_at(scale(share))} {HEIGHT - 8}l4 4l-4 4l-4 -4z"
        pieces.append(_mark("share", diamond, f"holds in {share:.0%} of trials"))
    elif strip.median is not None and math.isfinite(strip.median):
        pieces.append(_mark("median", f"M{_at(scale(strip.median))} 4V{HEIGHT - 4}", f"median {number(strip.median)}"))
    pieces.append(Markup('<g class="dots">{}</g>').format(Markup("").join(_dots(strip, scale))))
    if _right(part) < WIDTH - EDGE:
        pieces.append(Markup('<path class="wall" d="M{0} 1V{1}"/>').format(WIDTH - APART + 3, HEIGHT))
        pieces += _apart(strip)
    name = f"{strip.label}, {plural(strip.n, 'trial')}, median {strip.middle}"
    return _svg(WIDTH, HEIGHT, pieces, name)


def axis_svg(part: Part) -> Markup:
    """Draw the axis below a part's strips."""
    low, high = part_scale(part)
    scale = _Scale(low, high, right=_right(part))
    pieces = []
    for value, label in (
        ((0.0, "no"), (1.0, "yes")) if part.event else ((tick, number(tick)) for tick in ticks(low, high))
    ):
        pieces.append(Markup('<path class="rule" d="M{} 0v4"/>').format(_at(scale(value))))
        pieces.append(_text("tick", scale(value), 14, label))
    for bound in part.bounds:
        pieces.append(_text("named", scale(bound.value), 27, f"{bound.name} {number(bound.value)}"))
    if _right(part) < WIDTH - EDGE:
        pieces.append(_text("tick", WIDTH - APART / 2, 14, "no number"))
    return _svg(WIDTH, AXIS if part.bounds else 18.0, pieces, "")


def curves_svg(panel: CurvePanel, name: str) -> Markup:
    """Draw a panel of training curves; `name` says what it shows."""
    width, height = PANEL
    end = _shown(max((float(line.x.max()) for line in panel.lines if len(line.x)), default=1.0))
    ys = _ends([line.y for line in panel.lines])
    x = _Scale(0.0, end or 1.0, LEFT, width - RIGHT)
    y = _Scale(*ys, height - BOTTOM, TOP)
    pieces = [Markup('<path class="rule" d="M{0} {1}V{2}H{3}"/>').format(LEFT, TOP, height - BOTTOM, width - RIGHT)]
    for value in ticks(*ys, most=3):
        pieces.append(_text("small", LEFT - 4, y(value) + 3, large(value), "end"))
    for value, anchor in ((0.0, "start"), (end, "end")):
        pieces.append(_text("small", x(value), height - 8, large(value), anchor))
    for line in panel.lines:
        paths = zip(("line", "point"), _paths(line, x, y), strict=True)
        pieces += [_mark(kind, path, line.label) for kind, path in paths if path]
    return _svg(width, height, pieces, name)


def ticks(low: float, high: float, most: int = 5) -> list[float]:
    """Return at most `most` + 1 round values from `low` to `high`; one if no floats lie between."""
    if high - low < max(LEAST, 1e-9 * max(abs(low), abs(high))):
        return [low]
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [step * index for index in range(first, last + 1)]


class _Scale:
    def __init__(self, low: float, high: float, left: float = EDGE, right: float = WIDTH - EDGE) -> None:
        self.low, self.high, self.left, self.right = low, high, left, right

    def __call__(self, value: float) -> float:
        """Return the position of a value; one beyond an end is put at that end."""
        shown = min(max(value, self.low), self.high)  # before any arithmetic: an enormous value would overflow
        return self.left + (shown - self.low) / ((self.high - self.low) or 1.0) * (self.right - self.left)


def _shown(value: float) -> float:
    return min(max(value, -MOST), MOST)


def _right(part: Part) -> float:
    """Return where the axis ends: before the column of trials without a finite value, if there are any."""
    return WIDTH - EDGE - (APART if any(strip.apart for strip in part.strips) else 0.0)


def _dots(strip: Strip, scale: _Scale) -> Iterator[Markup]:
    """Draw a dot per trial; values too close for two dots side by side share a block around their mean."""
    ordered = sorted(strip.dots, key=lambda dot: (dot.value, dot.seed))
    places = [scale(dot.value) for dot in ordered]
    start = 0
    while start < len(ordered):
        end, total = start + 1, places[start]
        left, right, room, rows = _block(total, 1)
        while end < len(ordered) and places[end] < right:
            total += places[end]
            end += 1
            left, right, room, rows = _block(total, end - start)
        radius = _at(room * 0.43)
        for index, dot in enumerate(ordered[start:end]):
            column, row = divmod(index, rows)
            deep = min(rows, end - start - column * rows)
            x, y = left + (column + 0.5) * room, (HEIGHT - 8) / 2 + (row - (deep - 1) / 2) * room
            says = escape(f"seed {strip.seed_in_words(dot.seed)}: {number(dot.value)}")
            # Nothing else needs escaping: the rest that is filled in is numbers.
            yield Markup(f'<circle cx="{_at(x)}" cy="{_at(y)}" r="{radius}"><title>{says}</title></circle>')  # noqa: S704
        start = end


def _block(total: float, count: int) -> tuple[float, float, float, int]:
    """Return where a block of dots begins, where the next dot may begin, the width of a dot, and the number of rows.

    Args:
        total: sum of the dots' positions.
        count: of dots.
    """
    room = min(DOT, math.sqrt((HEIGHT - 12) * BLOCK / count))
    columns = math.ceil(count / max(int((HEIGHT - 9) / room), 1))
    rows, width = math.ceil(count / columns), columns * room
    centre = total / count
    return centre - width / 2, centre + width / 2 + room / 2, room, rows


def _apart(strip: Strip) -> Iterator[Markup]:
    """Draw trials without a finite value as crosses in a column of their own; no side has more than `MAX_TRIALS`."""
    room = min(9.0, math.sqrt((HEIGHT - 10) * (APART - 12) / max(len(strip.apart), 1)))
    across = max(int((APART - 12) / room), 1)
    for index, (seed, why) in enumerate(strip.apart):
        row, column = divmod(index, across)
        x, y, r = _at(WIDTH - APART + 9 + column * room), _at(5 + row * room), _at(0.6 * room)
        yield _mark("broken", f"M{x} {y}l{r} {r}m0 -{r}l-{r} {r}", f"seed {strip.seed_in_words(seed)}: {why}")


def _ends(series: Sequence[np.ndarray[tuple[int, ...], np.dtype[np.float64]]]) -> tuple[float, float]:
    """Return the lowest and the highest finite value; 0 and 1 without any."""
    finite = np.concatenate([values[np.isfinite(values)] for values in series])
    if not len(finite):
        return 0.0, 1.0
    low, high = _shown(float(finite.min())), _shown(float(finite.max()))
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def _paths(line: Line, x: _Scale, y: _Scale) -> tuple[str, str]:
    """Return a curve as path data, with a gap where a value is not finite, and its points that no line reaches.

    Flat stretches take two points. Each point is given from the one before, in halves of a unit: curves are most of the
    page, and these steps repeat.
    """
    path: list[str] = []
    pen, last = "M", (0, 0)
    # Rounded before the difference, so that no error adds up.
    heights = [round(2 * y(up)) if math.isfinite(up) else None for up in line.y]
    for index, (across, height) in enumerate(zip(line.x, heights, strict=True)):
        if height is None:
            pen = "M"
            continue
        flat = 0 < index < len(heights) - 1 and heights[index - 1] == height == heights[index + 1]
        place = (round(2 * x(across)), height)
        if pen != "M" and (flat or place == last):
            continue
        before = (0, 0) if pen == "M" else last
        path.append(f"{pen}{(place[0] - before[0]) / 2:g} {(place[1] - before[1]) / 2:g}")
        pen, last = "l" if pen == "M" else " ", place
    alone = [step[0] == after[0] == "M" for step, after in pairwise([*path, "M"])]
    joined = "".join(step for step, lone in zip(path, alone, strict=True) if not lone)
    return joined, "".join(f"{step}h0" for step, lone in zip(path, alone, strict=True) if lone)


def _mark(kind: str, path: str, title: str) -> Markup:
    """Draw a path with a title that is shown under the pointer."""
    return Markup('<path class="{}" d="{}"><title>{}</title></path>').format(kind, path, title)


def _text(kind: str, x: float, y: float, text: str, anchor: str = "middle") -> Markup:
    drawn = Markup('<text class="{}" x="{}" y="{}" text-anchor="{}">{}</text>')
    return drawn.format(kind, _at(x), _at(y), anchor, text)


def _at(place: float) -> str:
    return f"{place:.1f}".removesuffix(".0")


def _svg(width: float, height: float, pieces: Sequence[Markup], name: str) -> Markup:
    """Return a drawing; one without a name is decoration."""
    role = Markup('role="img" aria-label="{}"').format(name) if name else Markup('aria-hidden="true"')
    inside = Markup("").join(pieces)
    return Markup('<svg viewBox="0 0 {} {}" {}>{}</svg>').format(_at(width), _at(height), role, escape(inside))


SPARK_WIDTH, SPARK_HEIGHT, SPARK_EDGE = 36, 14, 2.5
MOST_STRIPS: Final = 4


def spark_svg(parts: Sequence[Part]) -> Markup:
    """Draw the trials of the part that decided; nothing where there are none.

    An event is a bar, as long as the share of trials in which it holds; other samples are a row of dots each, the
    first on top, with a line where they are compared with a number.
    """
    part = next((part for part in parts if part.decided), parts[0] if parts else None)
    if part is None or not any(strip.dots for strip in part.strips):
        return Markup("")
    inside = Markup("").join(_share(part.strips[0]) if part.event else _rows(part))
    return Markup('<svg class="spark" viewBox="0 0 {} {}" aria-hidden="true">{}</svg>').format(
        SPARK_WIDTH, SPARK_HEIGHT, inside
    )


def _share(strip: Strip) -> Iterator[Markup]:
    """Yield the bar of an event, over one as long as all trials."""
    length = SPARK_WIDTH - 2 * SPARK_EDGE
    held = sum(dot.value for dot in strip.dots) / strip.n * length
    for kind, long in (("all", length), ("held", held)):
        yield Markup('<path class="{}" d="M{} {}h{}"/>').format(kind, SPARK_EDGE, SPARK_HEIGHT / 2, f"{long:.3g}")


def _rows(part: Part) -> Iterator[Markup]:
    """Yield what is compared with, and a row for each sample; of many, as for a trend, the medians alone."""
    low, high = part_scale(part)

    def at(value: float) -> str:
        shown = min(max(value, low), high)
        return f"{round(SPARK_EDGE + (shown - low) / ((high - low) or 1.0) * (SPARK_WIDTH - 2 * SPARK_EDGE), 1):g}"

    for bound in part.bounds:
        yield Markup('<path class="compared" d="M{} 0V{}"/>').format(at(bound.value), SPARK_HEIGHT)
    rows = [[dot.value for dot in strip.dots] for strip in part.strips]
    if len(rows) > MOST_STRIPS:
        rows = [[strip.median] if strip.median is not None else [] for strip in part.strips]
    for index, values in enumerate(rows):
        up = f"{(index + 0.5) * SPARK_HEIGHT / len(rows):.3g}"
        places = "".join(f"M{place} {up}h0" for place in dict.fromkeys(map(at, sorted(values))))
        yield Markup('<path class="trials" d="{}"/>').format(places)
