"""The paper's own statistics, and Holm's correction."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kruskal, mannwhitneyu

from evoclaims.judging.descriptive import asterisks, kruskal_wallis, pairwise_mann_whitney
from evoclaims.judging.multiplicity import holm


@pytest.mark.parametrize(
    ("p", "stars"), [(0.5, ""), (0.05, ""), (0.049, "*"), (0.005, "*"), (0.0049, "**"), (0.00049, "***")]
)
def test_asterisks_mark_p_below_the_papers_thresholds(p: float, stars: str) -> None:
    assert asterisks(p) == stars


def test_kruskal_wallis_is_scipys_except_on_constant_data() -> None:
    assert kruskal_wallis([[1, 2, 3], [4, 5, 6]]) == kruskal([1, 2, 3], [4, 5, 6]).pvalue
    assert kruskal_wallis([[1, 1], [1, 1]]) == 1.0


def test_every_pair_gets_a_two_sided_bracket() -> None:
    groups = {"a": [1.0, 2, 3, 4, 5], "b": [6.0, 7, 8, 9, 10], "c": [1.5, 2.5, 3.5, 4.5, 5.5]}
    brackets = pairwise_mann_whitney(groups)
    assert [(bracket.left, bracket.right) for bracket in brackets] == [("a", "b"), ("a", "c"), ("b", "c")]
    assert brackets[0].p == mannwhitneyu(groups["a"], groups["b"], alternative="two-sided").pvalue
    assert [bracket.asterisks for bracket in brackets] == ["*", "", "*"]


def test_constant_groups_get_an_empty_bracket() -> None:
    (bracket,) = pairwise_mann_whitney({"a": [1.0, 1.0], "b": [1.0, 1.0]})
    assert (bracket.p, bracket.asterisks) == (1.0, "")


@pytest.fixture(scope="module")
def _little_garbage() -> Iterator[None]:
    """Keep garbage collection, which statsmodels asks for at every call, from going through all programs of a run."""
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.usefixtures("_little_garbage")
@given(st.lists(st.floats(0, 1), max_size=6))
@settings(deadline=None, max_examples=30)
def test_holm_steps_down_from_the_smallest_p(ps: list[float]) -> None:
    order = sorted(range(len(ps)), key=ps.__getitem__)
    expected, running = [0.0] * len(ps), 0.0
    for step, index in enumerate(order):
        running = max(running, min(1.0, (len(ps) - step) * ps[index]))
        expected[index] = running
    assert holm(ps) == pytest.approx(tuple(expected))
