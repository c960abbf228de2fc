"""The exact trend test against enumeration of all arrangements."""

from __future__ import annotations

import math
from collections import Counter
from itertools import combinations, permutations, product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.judging.kendall import trend_attainable, trend_test

profiles = st.integers(2, 4).flatmap(
    lambda levels: st.lists(
        st.lists(st.sampled_from([-math.inf, 0.0, 0.5, 1.0]), min_size=levels, max_size=levels),
        min_size=1,
        max_size=2,
    )
)


def kendall_s(row: tuple[float, ...]) -> int:
    """Return Kendall's S of a row against the level index."""
    return sum((later > earlier) - (later < earlier) for earlier, later in combinations(row, 2))


def enumerated(rows: list[list[float]]) -> tuple[float, float]:
    """Return p and the smallest p of falling, over every arrangement within every row."""
    observed = sum(kendall_s(tuple(row)) for row in rows)
    each = [Counter(kendall_s(arrangement) for arrangement in permutations(row)) for row in rows]
    null: Counter[int] = Counter()
    for chosen in product(*(counts.items() for counts in each)):
        null[sum(s for s, _ in chosen)] += math.prod(count for _, count in chosen)
    total = sum(null.values())
    return sum(count for s, count in null.items() if s <= observed) / total, null[min(null)] / total


@given(profiles)
@settings(deadline=None)
def test_the_trend_test_equals_enumeration_of_all_arrangements(rows: list[list[float]]) -> None:
    test = trend_test(rows, "falls")
    assert (test.p, test.attainable_p) == pytest.approx(enumerated(rows), rel=1e-12)


@given(profiles)
@settings(deadline=None)
def test_rising_is_falling_of_the_negated_values(rows: list[list[float]]) -> None:
    negated = [[-value for value in row] for row in rows]
    assert trend_test(rows, "rises") == trend_test(negated, "falls")


def test_strict_falls_in_every_trial_reach_the_attainable_minimum() -> None:
    rows = [[3.0, 2.0, 1.0]] * 4
    assert trend_test(rows, "falls").p == trend_attainable(4, 3) == pytest.approx(1 / 6**4)


def test_a_trial_without_variation_adds_nothing() -> None:
    falling, failed = (3.0, 2.0, 1.0), (-math.inf,) * 3
    assert trend_test([falling, failed], "falls") == trend_test([falling], "falls")


@pytest.mark.parametrize("rows", [[], [[1.0]], [[1.0, 2.0], [1.0, 2.0, 3.0]]])
def test_trials_without_levels_in_common_are_rejected(rows: list[list[float]]) -> None:
    with pytest.raises(ValueError, match="two or more levels"):
        trend_test(rows, "falls")


def test_a_trend_cannot_rank_nan() -> None:
    with pytest.raises(ValueError, match="NaN"):
        trend_test([[1.0, math.nan]], "falls")


def test_an_unknown_direction_lists_the_known_ones() -> None:
    with pytest.raises(ValueError, match="falls, rises"):
        trend_test([[1.0, 2.0]], "sinks")  # type: ignore[arg-type]
