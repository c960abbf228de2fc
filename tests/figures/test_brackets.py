"""Significance brackets: the paper's tests, and brackets that do not meet."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kruskal, mannwhitneyu

from evoclaims.figures.brackets import compare, stack


def test_p_is_scipys_two_sided_mann_whitney_and_kruskal_wallis() -> None:
    rng = np.random.default_rng(3)
    samples = [rng.normal(shift, 1.0, 10).tolist() for shift in (0.0, 0.2, 2.0)]
    found = {(c.left, c.right): c for c in compare(samples, [[0, 1, 2]])}
    assert set(found) == {(0, 1), (0, 2), (1, 2)}
    for (i, j), comparison in found.items():
        assert comparison.p == mannwhitneyu(samples[i], samples[j], alternative="two-sided").pvalue
        assert comparison.overall == kruskal(*samples).pvalue


def test_asterisks_are_the_papers() -> None:
    low, high = list(range(8)), list(range(100, 108))
    ((comparison),) = compare([low, high], [[0, 1]])
    assert comparison.p == pytest.approx(2 / math.comb(16, 8))
    assert comparison.asterisks == "***"
    ((comparison),) = compare([low[:4], high[:4]], [[0, 1]])
    assert comparison.p == pytest.approx(2 / math.comb(8, 4))
    assert comparison.asterisks == "*"


def test_a_pair_is_not_marked_where_its_family_as_a_whole_does_not_differ() -> None:
    a, b = [0.0, 1.0, 2.0, 3.0], [4.0, 5.0, 6.0, 7.0]
    between = [1.5, 2.5, 3.5, 4.5, 5.5]
    pair = next(c for c in compare([a, b, between, between, between], [[0, 1, 2, 3, 4]]) if (c.left, c.right) == (0, 1))
    assert pair.p < 0.05 <= pair.overall
    assert pair.asterisks == ""


def test_what_has_not_run_is_compared_with_nothing() -> None:
    found = compare([[1.0, 2.0], [], [3.0, 4.0]], [[0, 1, 2]])
    assert [(c.left, c.right, c.family) for c in found] == [(0, 2, (0, 2))]
    assert compare([[1.0, 2.0], []], [[0, 1]]) == ()


def test_constant_and_infinitely_bad_samples_are_compared_without_a_warning() -> None:
    ((same),) = compare([[1.0] * 3, [1.0] * 3], [[0, 1]])
    assert (same.p, same.overall, same.asterisks) == (1.0, 1.0, "")
    ((worst),) = compare([[-math.inf] * 5, [1.0, 2.0, 3.0, 4.0, 5.0]], [[0, 1]])
    assert worst.p < 0.05


@given(
    st.lists(st.floats(0.0, 10.0), min_size=2, max_size=7).flatmap(
        lambda tops: st.tuples(
            st.just(tops),
            st.lists(st.sets(st.integers(0, len(tops) - 1), min_size=2, max_size=2).map(sorted), max_size=12),
        )
    )
)
def test_brackets_lie_above_what_they_span_and_a_row_apart(case: tuple[list[float], list[list[int]]]) -> None:
    tops, pairs = case
    spans, row = [(float(a), float(b)) for a, b in pairs], 0.7
    heights = stack(spans, list(enumerate(tops)), row)
    for (left, right), height in zip(spans, heights, strict=True):
        assert height > max(tops[int(left) : int(right) + 1])
    for i, (a, one) in enumerate(zip(spans, heights, strict=True)):
        for b, other in list(zip(spans, heights, strict=True))[i + 1 :]:
            if a[0] <= b[1] and b[0] <= a[1]:
                assert abs(one - other) >= row
