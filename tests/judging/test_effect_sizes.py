"""Effect sizes, and intervals that only describe."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.judging.effect import a12, a12_interval, cliffs_delta, iqm, iqm_interval, median, median_interval

values = st.lists(st.floats(-3, 3) | st.sampled_from([-math.inf, math.inf]), min_size=1, max_size=8)


def test_a12_counts_wins_and_half_the_ties() -> None:
    assert a12([1, 2, 3], [2, 2]) == pytest.approx((0 + 2 * 0.5 + 2) / 6)


@given(values, values)
def test_swapping_sides_negates_the_effect(a: list[float], b: list[float]) -> None:
    assert cliffs_delta(a, b) == -cliffs_delta(b, a)
    assert a12(a, b) == pytest.approx(1 - a12(b, a))


@pytest.mark.parametrize(
    ("data", "middle"),
    [([3, 1, 2], 2), ([1, 2, 3, 10], 2.5), ([-math.inf, -math.inf], -math.inf), ([-math.inf, 1, 2], 1)],
)
def test_the_median_ranks_infinities(data: list[float], middle: float) -> None:
    assert median(data) == middle


@given(values, values)
@settings(max_examples=30)
def test_the_interval_of_a12_lies_in_the_unit_interval_and_repeats(a: list[float], b: list[float]) -> None:
    low, high = a12_interval(a, b)
    assert 0 <= low <= high <= 1
    assert a12_interval(a, b) == (low, high)


def test_the_intervals_of_constant_data_are_points() -> None:
    assert a12_interval([1.0] * 5, [1.0] * 5) == (0.5, 0.5)
    assert median_interval([2.0] * 5) == (2.0, 2.0)


def test_the_interval_of_a_median_holds_it_and_survives_failed_trials() -> None:
    low, high = median_interval([-math.inf, -math.inf, 1.0, 2.0, 3.0])
    assert low == -math.inf
    assert low < 1.0 < high


def test_the_interquartile_mean_is_that_of_the_middle_half() -> None:
    assert iqm([0, 1, 2, 3, 4, 5, 6, 100]) == pytest.approx((2 + 3 + 4 + 5) / 4)
    assert iqm([-math.inf, -math.inf, 1, 2, 3, 4, 5, 6]) == pytest.approx(2.5)
    assert iqm([-math.inf] * 3 + [1] * 5) == -math.inf


def test_the_interval_of_the_interquartile_mean_resamples_each_stratum_by_itself() -> None:
    # Strata of constants: each resample holds as many of each as there are, so that the mean never changes.
    assert iqm_interval([0.0] * 8, [1.0] * 8) == (0.5, 0.5)
    low, high = iqm_interval([0.0] * 8 + [1.0] * 8)
    assert low < 0.5 < high
    assert iqm_interval([-math.inf] * 4 + [1.0] * 6)[0] == -math.inf
