"""The omnibus test: its p is that of enumeration, and drawn splits err no more often than alpha."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kruskal

from evoclaims.core.errors import UserError
from evoclaims.judging.design import FIXED_10, Design
from evoclaims.judging.exact import ExactTest, binomial_test
from evoclaims.judging.judge import judge
from evoclaims.judging.kinds import omnibus
from evoclaims.judging.kinds.omnibus import any_differ, kruskal_wallis_test
from evoclaims.judging.verdict import Outcome

SUPPORTED, REFUTED, INCONCLUSIVE = Outcome.SUPPORTED, Outcome.REFUTED, Outcome.INCONCLUSIVE
SIZES = [(2, 2, 2), (1, 2, 3), (3, 3, 1), (2, 1, 2, 1)]


def splits(values: Sequence[float], sizes: Sequence[int]) -> Iterator[list[list[float]]]:
    """Yield all ways to give the values to groups of these sizes."""
    if len(sizes) == 1:
        yield [list(values)]
        return
    for chosen in combinations(range(len(values)), sizes[0]):
        rest = [value for index, value in enumerate(values) if index not in chosen]
        yield from ([[values[index] for index in chosen], *others] for others in splits(rest, sizes[1:]))


def between(groups: Sequence[Sequence[float]]) -> Fraction:
    """Return the sum of squared rank sums over sizes, from its definition and without rounding."""
    pooled = [value for group in groups for value in group]

    def rank(value: float) -> Fraction:
        return Fraction(sum(x < value for x in pooled)) + Fraction(sum(x == value for x in pooled) + 1, 2)

    return sum((sum(map(rank, group), Fraction(0)) ** 2 / len(group) for group in groups), Fraction(0))


@settings(max_examples=25)
@given(st.sampled_from(SIZES), st.data())
def test_p_is_the_share_of_all_splits_that_are_as_far_apart(sizes: tuple[int, ...], data: st.DataObject) -> None:
    values = st.lists(st.integers(0, 4).map(float) | st.just(-np.inf), min_size=sum(sizes), max_size=sum(sizes))
    pooled = data.draw(values)
    starts = np.cumsum([0, *sizes])
    groups = [pooled[start : start + size] for start, size in zip(starts, sizes, strict=False)]
    spreads = [between(split) for split in splits(pooled, sizes)]
    found = kruskal_wallis_test(groups)
    assert found.p == sum(spread >= between(groups) for spread in spreads) / len(spreads)
    assert found.attainable_p == spreads.count(max(spreads)) / len(spreads)


@given(st.lists(st.integers(0, 3), min_size=9, max_size=9))
def test_trials_are_ordered_by_kruskal_and_walliss_h(values: list[int]) -> None:
    groups = [values[:3], values[3:6], values[6:]]
    others = [values[::3], values[1::3], values[2::3]]
    if len(set(values)) > 1:
        above = kruskal(*groups).statistic - kruskal(*others).statistic
        assert abs(above) < 1e-9 or (above > 0) == (kruskal_wallis_test(groups).p < kruskal_wallis_test(others).p)


@pytest.mark.parametrize("pooled", [range(9), [0, 0, 0, 1, 1, 2, 3, 4, 5], [0] * 6 + [1] * 3, [0] * 9])
def test_among_all_splits_of_three_threes_none_is_rejected_too_often(pooled: Sequence[int]) -> None:
    ps = [kruskal_wallis_test(split).p for split in splits(list(map(float, pooled)), (3, 3, 3))]
    assert len(ps) == 1680
    for alpha in (0.05, 0.04, 0.01):
        assert sum(p <= alpha for p in ps) <= alpha * len(ps)


def test_drawn_splits_estimate_the_p_of_all_and_are_never_0(monkeypatch: pytest.MonkeyPatch) -> None:
    groups = [[1.0, 2.0, 5.0, 6.0], [3.0, 4.0, 8.0, 9.0], [7.0, 10.0, 11.0, 12.0]]
    exact = kruskal_wallis_test(groups)
    monkeypatch.setattr(omnibus, "MOST_SPLITS", 0)
    drawn = kruskal_wallis_test(groups)
    assert drawn.p != exact.p
    assert drawn.p == pytest.approx(exact.p, abs=4 * (exact.p / omnibus.DRAWN) ** 0.5)
    assert drawn == kruskal_wallis_test(groups)
    far = [[value + 100 * index for value in range(10)] for index in range(4)]
    assert kruskal_wallis_test(far).p == kruskal_wallis_test(far).attainable_p == 1 / (omnibus.DRAWN + 1)


@pytest.mark.parametrize("of", ["continuous", "three values"])
def test_drawn_splits_err_no_more_often_than_alpha(of: str) -> None:
    rng, draws = np.random.default_rng(0), 600
    shape = (draws, 3, 10)
    data = rng.normal(size=shape) if of == "continuous" else rng.integers(0, 3, shape)
    ps = np.array([kruskal_wallis_test(groups).p for groups in data])
    for alpha in (0.05, 0.01):
        assert binomial_test(int((ps <= alpha).sum()), draws, alpha).p > 1e-3


@pytest.mark.parametrize("groups", [[[1.0], [], [2.0]], [[1.0], [2.0], [np.nan]]])
def test_what_cannot_be_ranked_is_an_error(groups: list[list[float]]) -> None:
    with pytest.raises(ValueError, match="at least one value in each group, and none that is NaN"):
        kruskal_wallis_test(groups)


RISING = [float(i) for i in range(10)]


def shifted(by: float) -> list[float]:
    return [value + by for value in RISING]


@pytest.mark.parametrize(
    ("third", "margin", "outcome"),
    [
        (shifted(20), None, SUPPORTED),
        (shifted(-20), None, SUPPORTED),
        (RISING, None, INCONCLUSIVE),
        (["diverged"] * 10, None, SUPPORTED),
        (shifted(20), 8.0, SUPPORTED),
        (RISING, 8.0, REFUTED),
        (RISING, 2.0, INCONCLUSIVE),
        (shifted(6), 50.0, INCONCLUSIVE),  # they differ, and by less than matters
    ],
)
def test_some_of_several_conditions_differ(source, third, margin, outcome) -> None:
    measures = [source(name, values).score() for name, values in (("a", RISING), ("b", RISING), ("c", third))]
    verdict = judge(any_differ(*measures, margin=margin), FIXED_10)
    assert verdict.outcome is outcome
    assert verdict.evidence[0].detail.endswith("they differ, and by less than the margin") == (margin == 50.0)
    assert [sample.label for sample in verdict.evidence[0].samples] == ["a: score", "b: score", "c: score"]


def test_without_a_margin_only_one_direction_is_attainable(source) -> None:
    a, b, c = (source(name, RISING).score() for name in "abc")
    assert any_differ(a, b, c).attainable(3, FIXED_10).supported == 6 / 1680
    assert any_differ(a, b, c).attainable(3, FIXED_10).refuted == 1.0
    assert any_differ(a, b, c, margin=1.0).attainable(3, FIXED_10).refuted == 0.05
    assert any_differ(a, b, c).attainable(1, FIXED_10).supported == 1.0
    verdict = judge(any_differ(a, b, c), Design.fixed(2))
    assert verdict.reason == "underpowered: needs n = 3 at alpha = 0.05"
    (evidence,) = judge(any_differ(a, b, c), FIXED_10).evidence
    assert evidence.detail.endswith("p over 9,999 drawn splits; without a margin nothing can refute it")
    assert judge(any_differ(a, b, c), Design.fixed(3)).evidence[0].detail == (
        "conditions explain 0% of the ranks' variance; p over all splits; without a margin nothing can refute it"
    )


def test_the_attainable_p_never_rises_with_the_number_of_trials(source) -> None:
    for k in (3, 4, 6):
        claim = any_differ(*(source(str(index), []).score() for index in range(k)))
        ps = [claim.attainable(n, FIXED_10).supported for n in range(1, 30)]
        assert ps == sorted(ps, reverse=True)


@pytest.mark.parametrize("rows", list(product([RISING, shifted(20)], repeat=3)))
def test_a_pair_is_asserted_behind_the_gate(source, rows) -> None:
    a, b, c = (source(name, values).score() for name, values in zip("abc", rows, strict=True))
    gate, pair = any_differ(a, b, c), a > b
    both = judge(gate & pair, FIXED_10)
    assert (both.outcome is SUPPORTED) == (rows[0] == shifted(20) and rows[1] == RISING)
    assert both.p == max(judge(gate, FIXED_10).p, judge(pair, FIXED_10).p)


def test_three_or_more_measures_of_different_trials_are_compared(source) -> None:
    a, b, c = (source(name, []) for name in "abc")
    with pytest.raises(UserError, match="three or more measures"):
        any_differ(a.score(), b.score())
    with pytest.raises(UserError, match="three or more measures"):
        any_differ()
    with pytest.raises(UserError, match="same trials"):
        any_differ(a.score(), b.score(), a.score())
    with pytest.raises(UserError, match="one direction"):
        any_differ(a.score(), b.score(), c.score("lower"))
    with pytest.raises(UserError, match="measures of trials"):
        any_differ(a.score(), b.score(), 3)
    with pytest.raises(UserError, match="margin"):
        any_differ(a.score(), b.score(), c.score(), margin=0.0)


def test_the_sentence_names_every_condition(source) -> None:
    a, b, c = (source(name, []).score() for name in "abc")
    assert any_differ(a, b, c).describe() == "at least two of a: score, b: score and c: score differ"
    assert any_differ(a, b, c, margin=5).describe().endswith("c: score differ (it does not matter by less than 5)")
    assert [s.label for s in any_differ(a, b, c).sources()] == ["a", "b", "c"]


def test_many_conditions_are_compared_as_soon_as_few() -> None:
    groups = [[3.0 * k, 3.0 * k + 1, 3.0 * k + 2] for k in range(12)]  # whose 12! orders nobody can try
    assert kruskal_wallis_test(groups) == ExactTest(1e-4, 1e-4)
