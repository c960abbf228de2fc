"""The trials behind a verdict as a picture of a word's size."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from markupsafe import Markup

from evoclaims.report.charts import part_scale
from evoclaims.report.evidence import Part, Strip

WIDTH, HEIGHT, EDGE = 36, 14, 2.5
MOST_DOTS: Final = 40
"""Most trials a strip that are drawn one by one; beyond that, the span of the middle nine tenths and the median."""

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
    return Markup('<svg class="spark" viewBox="0 0 {} {}" aria-hidden="true">{}</svg>').format(WIDTH, HEIGHT, inside)


def _share(strip: Strip) -> Iterator[Markup]:
    """Yield the bar of an event, over one as long as all trials."""
    length = WIDTH - 2 * EDGE
    held = sum(dot.value for dot in strip.dots) / strip.n * length
    for kind, long in (("all", length), ("held", held)):
        yield Markup('<path class="{}" d="M{} {}h{}"/>').format(kind, EDGE, HEIGHT / 2, f"{long:.3g}")


def _rows(part: Part) -> Iterator[Markup]:
    """Yield what is compared with, and a row for each sample; of many, as for a trend, the medians alone."""
    low, high = part_scale(part)

    def at(value: float) -> str:
        shown = min(max(value, low), high)
        return f"{EDGE + (shown - low) / ((high - low) or 1.0) * (WIDTH - 2 * EDGE):.3g}"

    for bound in part.bounds:
        yield Markup('<path class="compared" d="M{} 0V{}"/>').format(at(bound.value), HEIGHT)
    rows = [[dot.value for dot in strip.dots] for strip in part.strips]
    if len(rows) > MOST_STRIPS:
        rows = [[strip.median] if strip.median is not None else [] for strip in part.strips]
    for index, values in enumerate(rows):
        up = f"{(index + 0.5) * HEIGHT / len(rows):.3g}"
        if len(values) <= MOST_DOTS:
            places = "".join(f"M{at(value)} {up}h0" for value in sorted(values))
        else:
            first, middle, last = (at(float(one)) for one in np.quantile(values, [0.05, 0.5, 0.95]))
            yield Markup('<path class="middle" d="M{} {}H{}"/>').format(first, up, last)
            places = f"M{middle} {up}h0"
        yield Markup('<path class="trials" d="{}"/>').format(places)
