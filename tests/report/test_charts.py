"""Small drawings: sound SVG in which every trial is found, whatever the values and names are."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from itertools import pairwise
from statistics import median_low
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from evoclaims.judging.exact import MAX_TRIALS
from evoclaims.judging.verdict import Bound, Interval
from evoclaims.report.charts import HEIGHT, WIDTH, axis_svg, curves_svg, strip_svg, ticks
from evoclaims.report.evidence import Dot, Part, Strip
from evoclaims.report.formatting import large
from evoclaims.report.training_curves import CurvePanel, Line

finite = st.floats(allow_nan=False, allow_infinity=False)


def _part(*values: float, **changes: object) -> Part:
    middle = median_low(values) if values else None
    strip = Strip("a on b: x", tuple(Dot(seed, value) for seed, value in enumerate(values)), (), middle)
    return replace(Part("a", None, (), "", False, (strip,)), **changes)  # type: ignore[arg-type]


def _drawn(part: Part) -> ElementTree.Element:
    axis_svg(part)
    return ElementTree.fromstring(strip_svg(part, part.strips[0]))


def _titles(svg: ElementTree.Element, tag: str) -> list[str]:
    return [element.findtext("title", "") for element in svg.iter(tag)]


def test_every_trial_is_a_dot_with_its_seed_and_value() -> None:
    svg = _drawn(_part(0.25, 0.5, 0.5))
    assert _titles(svg, "circle") == ["seed 0: 0.25", "seed 1: 0.5", "seed 2: 0.5"]
    places = {(circle.get("cx"), circle.get("cy")) for circle in svg.iter("circle")}
    assert len(places) == 3
    assert svg.get("aria-label") == "a on b: x, 3 trials, median 0.5"


def test_equal_values_share_a_block_around_their_place_and_overlap_nowhere() -> None:
    circles = list(_drawn(_part(*[1.0] * 40)).iter("circle"))
    x = [float(circle.get("cx", "")) for circle in circles]
    assert (min(x) + max(x)) / 2 == pytest.approx(WIDTH - 24.0, abs=0.2)
    radius = float(circles[0].get("r", ""))
    spots = [(a, float(circle.get("cy", ""))) for a, circle in zip(x, circles, strict=True)]
    nearest = min(np.hypot(a[0] - b[0], a[1] - b[1]) for i, a in enumerate(spots) for b in spots[:i])
    assert nearest > 2 * radius


def test_trials_without_a_number_stand_in_a_column_of_their_own() -> None:
    part = _part(0.5, 0.75)
    part = replace(part, strips=(replace(part.strips[0], apart=((7, "diverged"), (8, "NaN"))),))
    svg = _drawn(part)
    crosses = [path for path in svg.iter("path") if path.get("class") == "broken"]
    assert [path.findtext("title") for path in crosses] == ["seed 7: diverged", "seed 8: NaN"]
    wall = next(float(path.get("d", "")[1:].split()[0]) for path in svg.iter("path") if path.get("class") == "wall")
    assert max(float(circle.get("cx", "")) for circle in svg.iter("circle")) < wall
    assert min(float(path.get("d", "")[1:].split()[0]) for path in crosses) > wall
    assert "no number" in axis_svg(part)
    every = tuple((seed, "NaN") for seed in range(MAX_TRIALS))
    svg = _drawn(replace(part, strips=(replace(part.strips[0], apart=every),)))
    places = [
        path.get("d", "")[1:].partition("l")[0].split() for path in svg.iter("path") if path.get("class") == "broken"
    ]
    assert len(places) == MAX_TRIALS
    assert all(wall < float(x) < WIDTH - 4 and 4 < float(y) < HEIGHT - 4 for x, y in places)


def test_bounds_and_intervals_of_an_event_are_drawn() -> None:
    part = _part(1.0, 1.0, 0.0, 1.0, event=True, bounds=(Bound("p0", 0.7),), spans=(Interval("P", 0.3, 0.9),))
    said = _titles(_drawn(part), "path")
    assert "p0: 0.7" in said
    assert "P: 0.3 to 0.9" in said
    assert "holds in 75% of trials" in said
    assert [word in axis_svg(part) for word in (">no<", ">yes<", ">p0 0.7<")] == [True] * 3


@given(st.lists(finite, max_size=30), st.text(), st.text())
def test_any_values_and_names_make_a_sound_drawing(values: list[float], label: str, why: str) -> None:
    visible = "".join(c for c in label if c.isprintable())
    reason = "".join(c for c in why if c.isprintable())
    part = _part(*values)
    part = replace(part, strips=(replace(part.strips[0], label=visible, apart=((1, reason),), median=None),))
    svg = _drawn(part)
    assert svg.get("aria-label", "").startswith(f"{visible}, ")
    assert f"seed 1: {reason}" in _titles(svg, "path")
    places = [float(circle.get("cx", "")) for circle in svg.iter("circle")]
    assert len(places) == len(values)
    assert all(0 <= place <= WIDTH for place in places)


@given(finite, finite)
@example(-1.7976931348623155e308, -1.7976931348623157e308)
def test_ticks_are_few_rising_and_within_the_axis(one: float, other: float) -> None:
    low, high = sorted((one / 4, other / 4))
    found = ticks(low, high)
    room = 1e-6 * max(high - low, abs(low), abs(high))
    assert 1 <= len(found) <= 6
    assert all(low - room <= tick <= high + room for tick in found)
    assert all(a < b for a, b in pairwise(found)) or high - low <= room


def _corners(values: list[float]) -> list[np.ndarray[Any, Any]]:
    """Return the corners of each stretch of a curve that is drawn, from steps relative to the corner before."""
    line = Line("seed <0>", np.arange(float(len(values))), np.array(values))
    svg = ElementTree.fromstring(curves_svg(CurvePanel("success", (line,), 1), "success over training"))
    paths = [path for path in svg.iter("path") if path.get("class") in ("line", "point")]
    assert all(path.findtext("title") == "seed <0>" for path in paths)
    stretches = [one for path in paths for one in path.get("d", "").split("M")[1:]]
    return [
        np.array(one.replace("l", " ").removesuffix("h0").split(), float).reshape(-1, 2).cumsum(axis=0)
        for one in stretches
    ]


def test_a_curve_has_a_gap_where_it_has_no_value_and_two_points_for_a_flat_stretch() -> None:
    assert [len(one) for one in _corners([0, 1, math.nan, 1, 1, 1, 0])] == [2, 3]


@pytest.mark.parametrize(
    ("x", "y", "lines", "points"),
    [
        ([0, 1, 2], [5.0, math.nan, 6.0], [], ["M34 112h0M232 8h0"]),
        ([0, 1, 2, 3], [5.0, 6.0, math.nan, 5.0], ["M34 112l66 -104"], ["M232 112h0"]),
        ([7], [5.0], [], ["M232 60h0"]),
        ([0, 1000, 1000.001], [math.nan, 5.0, 5.0], [], ["M232 60h0"]),  # both at one place
        ([], [], [], []),
    ],
)
def test_a_point_that_no_line_reaches_is_a_dot(
    x: list[float], y: list[float], lines: list[str], points: list[str]
) -> None:
    panel = CurvePanel("success", (Line("seed 0", np.array(x), np.array(y)),), 1)
    svg = ElementTree.fromstring(curves_svg(panel, "success over training"))
    drawn = [[path.get("d") for path in svg.iter("path") if path.get("class") == kind] for kind in ("line", "point")]
    assert drawn == [lines, points]
    assert [text.text for text in svg.iter("text")][-1] == large(max(x, default=1.0))  # where the axis ends


@given(st.lists(st.one_of(st.just(math.nan), st.integers(-40, 40).map(float)), min_size=2, max_size=60))
def test_a_curve_passes_each_value_within_a_quarter_of_a_unit(values: list[float]) -> None:
    """However many steps there are, their roundings do not add up."""
    finite = [value for value in values if value == value]
    assume(finite)
    low, high = min(finite), max(finite)
    low, high = (low, high) if high > low else (low - 0.5, high + 0.5)
    corners = _corners(values)
    places = [round((x - 34) / (240 - 34 - 8) * (len(values) - 1)) for one in corners for x, _ in one]
    ups = dict(zip(places, (y for one in corners for _, y in one), strict=True))
    shown = -math.inf
    for index, value in enumerate(values):
        if value == value:
            shown = ups.get(index, shown)  # within a flat stretch, the corner at its start
            assert abs(shown - (112 - (value - low) / (high - low) * (112 - 8))) <= 0.25 + 1e-9
        else:
            assert index not in ups


@example([sys.float_info.max, -1e292])
@given(st.lists(st.floats(width=64), min_size=2, max_size=20))
def test_any_curve_makes_a_sound_drawing(values: list[float]) -> None:
    line = Line("seed 0", np.arange(len(values), dtype=float), np.array(values))
    ElementTree.fromstring(curves_svg(CurvePanel("success", (line,), 0), "success over training"))
