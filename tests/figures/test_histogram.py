"""Histograms: every trial counted once, in the panel of its condition."""

from __future__ import annotations

import math
from typing import Any

import pytest
from small_paper import ONE, OTHER, collisions, told, words

from evoclaims.figures.histogram import Histogram, HistogramPanel, Threshold

HISTOGRAM = Histogram(
    (HistogramPanel("first", ONE, "small"), HistogramPanel("second", OTHER, "small")),
    lambda trials: trials.reward,
    "reward",
    Threshold(8.0, "good"),
    ("A remark.",),
)


def _counts(axis: Any) -> list[float]:
    return [bar.get_height() for bar in axis.patches]


def test_every_trial_is_counted_once_and_is_a_dot(paper: Any) -> None:
    paper.put("one", "small", [0.1, 0.1, 0.5, *[0.9] * 7])
    paper.put("other", "small", [-0.3, 1.7])
    drawing = paper.draw(HISTOGRAM)
    first, second = drawing.figure.axes
    assert (sum(_counts(first)), max(_counts(first)), sum(_counts(second))) == (10, 7, 2)
    dots = [float(line.get_xdata()[0]) for line in first.lines if line.get_marker() == "o"]
    assert dots == pytest.approx([1, 1, 5, *[9] * 7])
    assert first.get_xlim() == second.get_xlim()
    assert first.get_xlim()[0] < -3 < 17 < first.get_xlim()[1]
    assert "second (2 of 10 trials)" in told(drawing)
    assert drawing.missing == ("Run in part: other on small (2 of 10 trials).",)
    assert drawing.shown == 12


def test_trials_without_a_number_are_in_no_bin(paper: Any) -> None:
    paper.put("one", "small", [(0.0, "diverged"), math.nan, 0.5])
    drawing = paper.draw(HISTOGRAM)
    paper.put("other", "small", [(0.0, "diverged")] * 10)
    assert "no values" in words(paper.draw(HISTOGRAM))
    assert sum(_counts(drawing.figure.axes[0])) == 1
    assert "not run" in words(drawing)
    assert "no values" not in words(drawing)
    assert set(drawing.table["status"].dropna()) == {"diverged", "not finite", "done", "not run"}


@pytest.mark.parametrize("values", [[], [0.8] * 10, [0.0] * 10])
def test_the_mark_is_always_in_sight(paper: Any, values: list[float]) -> None:
    paper.put("one", "small", values)
    drawing = paper.draw(HISTOGRAM)
    for axis in drawing.figure.axes:
        low, high = axis.get_xlim()
        assert low < 0.0 < 8.0 < high
    assert collisions(drawing) == []
