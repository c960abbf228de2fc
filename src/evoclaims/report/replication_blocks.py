"""Published numbers beside ours as a terminal shows them: a block for each condition, measure and variant."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from rich.cells import cell_len
from rich.table import Table

from evoclaims.figures.replication import Replication
from evoclaims.judging.repetition import Answer, Prediction, Spread
from evoclaims.report.console import GAP, plain_table
from evoclaims.report.formatting import number
from evoclaims.report.replication_cells import PROTOCOL, SYMBOLS, ours, published

LEGEND: Final = ", ".join(f"{symbol} {answer}" for answer, symbol in SYMBOLS.items())
"""What the symbols stand for."""

_HEADINGS: Final = ("", "", "published", "ours", "95% of repetitions")


def blocks(found: Sequence[Replication], width: int) -> Iterator[tuple[str, Table]]:
    """Yield the heading of each block and its table, whose columns have the same places in all.

    A block holds the levels of one condition under one variant ("neat on n_parity: success, rows_so_far"), or where a
    task has no levels the methods on it ("obstacles: episode reward").

    Args:
        found: the numbers.
        width: columns of the terminal. Where it is too narrow, two readings of an error bar have a line each.
    """
    varied = any(one.variant for one in found)
    made: dict[str, list[tuple[tuple[str, ...], list[str]]]] = {}
    for one in found:
        heading, label = _place(one, varied)
        cells = SYMBOLS[one.agreement], label, published(one), ours(one)
        made.setdefault(heading, []).append((cells, _intervals(one)))
    rows = [_HEADINGS, *((*cells, ", ".join(intervals)) for block in made.values() for cells, intervals in block)]
    widths = [max(map(cell_len, column)) for column in zip(*rows, strict=True)]
    between = ",\n" if sum(widths) + GAP * (len(widths) - 1) > width else ", "
    for place, (heading, block) in enumerate(made.items()):
        lines = [(*cells, between.join(intervals)) for cells, intervals in block]
        table = plain_table(_HEADINGS, lines, names=len(_HEADINGS))
        for column, least in zip(table.columns[:-1], widths, strict=False):
            column.min_width = least
        table.show_header = not place
        yield heading, table


def _place(one: Replication, varied: bool) -> tuple[str, str]:
    """Return the heading that a number belongs to, with the variant if several are shown, and its name below it."""
    readings = one.readings
    under = f", {one.variant or PROTOCOL}" if varied else ""
    if one.level is None:
        return f"{readings.task}: {readings.name}{under}", readings.method
    return f"{readings.method} on {readings.task}: {readings.name}{under}", f"level {one.level}"


def _intervals(one: Replication) -> list[str]:
    """Return the interval by each reading of the published spread, or why it is missing."""
    return [*map(_interval, one.repetition.predictions)] or [one.repetition.reason]


def _interval(prediction: Prediction) -> str:
    """Return an interval, such as "0.776–0.938 SD ✗", or "7–10 trials at 1: ours 2"."""
    ends = f"{number(prediction.low)}–{number(prediction.high)}"
    if prediction.spread is Spread.NONE:
        got = "" if prediction.ours is None else f": ours {number(prediction.ours)}"
        return f"{ends} {prediction.of}{got}"
    mark = {Answer.INSIDE: " ✓", Answer.OUTSIDE: " ✗"}.get(prediction.answer, "")
    return f"{ends} {prediction.spread.short}{mark}"
