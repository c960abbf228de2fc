"""Prediction intervals for a published mean: coverage, scale, exact arguments, and when nothing can be said."""

from __future__ import annotations

import math
import statistics
from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, fisher_exact
from scipy.stats import t as student

from evoclaims.judging.repetition import (
    FEWEST,
    Agreement,
    Answer,
    Prediction,
    PublishedMean,
    Repetition,
    Spread,
    detectable_share,
    detectable_shift,
    repetition,
)

DRAWN = 2_000
UNIT = (0.0, 1.0)

values = st.floats(-100, 100)
spreads = st.floats(0.01, 100)
several = st.lists(values, min_size=FEWEST, max_size=12)


def _of(found: Repetition, reading: Spread) -> Prediction:
    (prediction,) = [one for one in found.predictions if one.spread is reading]
    return prediction


@pytest.mark.parametrize("reading", [Spread.DEVIATION, Spread.STANDARD_ERROR])
@pytest.mark.parametrize("n", [5, 10])
def test_a_repetition_of_normal_trials_is_inside_in_95_of_100_draws(reading: Spread, n: int) -> None:
    rng = np.random.default_rng(20261122)
    inside = 0
    for theirs, ours in zip(rng.normal(3.0, 2.0, (DRAWN, 10)), rng.normal(3.0, 2.0, (DRAWN, n)), strict=True):
        bar = statistics.stdev(theirs) / (1.0 if reading == Spread.DEVIATION else math.sqrt(10))
        found = repetition(PublishedMean(float(theirs.mean()), bar, 10), [*map(float, ours)], 10)
        inside += _of(found, reading).answer is Answer.INSIDE
    assert inside / DRAWN == pytest.approx(0.95, abs=3 * math.sqrt(0.95 * 0.05 / DRAWN))


@pytest.mark.parametrize(
    ("population", "lowest", "highest"),
    [
        ([0.5, 0.55, 0.6, 0.75, 0.75, 0.8, 0.9, 1.0, 1.0, 1.0], 0.93, 0.97),
        ([0.7, 0.93, 0.96, 0.98, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0], 0.7, 0.9),
    ],
    ids=["spread over the scale", "most at its end"],
)
def test_where_most_trials_are_at_the_end_of_the_scale_fewer_repetitions_are_inside(
    population: list[float], lowest: float, highest: float
) -> None:
    """As docs/replication.md warns: such a population is not normal, and one low trial makes much of its spread."""
    rng = np.random.default_rng(20261122)
    inside = 0
    for theirs, ours in zip(*rng.choice(population, (2, DRAWN, 10)), strict=True):
        published = PublishedMean(float(theirs.mean()), statistics.stdev(theirs), 10, UNIT)
        inside += repetition(published, [*map(float, ours)], 10).predictions[0].answer is Answer.INSIDE
    assert lowest <= inside / DRAWN <= highest


@pytest.mark.parametrize("probability", [0.5, 0.9, 0.99])
def test_a_repetition_of_trials_all_at_the_end_of_the_scale_is_seldom_outside(probability: float) -> None:
    """Exactly: all ten published trials are at the end, and too few of ours; for any probability at most 5%."""
    (prediction,) = repetition(PublishedMean(1.0, 0.0, 10, UNIT), [], 10).predictions
    too_few = sum(comb(10, k) * probability**k * (1 - probability) ** (10 - k) for k in range(int(prediction.low)))
    assert probability**10 * too_few <= 0.05
    assert (prediction.of, prediction.low, prediction.high) == ("trials at 1", 7.0, 10.0)


@given(mean=values, error=spreads, ours=several)
def test_a_planted_shift_is_outside(mean: float, error: float, ours: list[float]) -> None:
    """By the bar's width times ten, under both readings; unshifted, the same spread of values is inside."""
    centred = [x / 200 * error / 10 for x in ours]
    centred = [mean + x - statistics.fmean(centred) for x in centred]
    published = PublishedMean(mean, error, 10)
    assert repetition(published, centred, 10).answer is Answer.INSIDE
    for shift in (10 * error, -10 * error):
        assert repetition(published, [x + shift for x in centred], 10).answer is Answer.OUTSIDE


def test_where_the_readings_of_a_bar_disagree_nothing_can_be_said() -> None:
    found = repetition(PublishedMean(0.0, 1.0, 10), [1.0, 2.0] * 5, 10)
    assert found.answer is Answer.UNKNOWN
    assert found.reason == "outside if the bar is a standard deviation; inside if the bar is a standard error"


def test_a_bar_too_long_for_a_standard_error_on_its_scale_is_read_as_a_deviation() -> None:
    """0.82 ± 0.21 on [0, 1]: 0.21 √10 is 0.66, and no ten such numbers deviate by more than 0.41."""
    found = repetition(PublishedMean(0.82, 0.21, 10, UNIT), [1.0] * 10, 10)
    assert [prediction.spread for prediction in found.predictions] == [Spread.DEVIATION]
    assert (found.answer, found.predictions[0].high) == (Answer.INSIDE, 1.0)
    assert found.reason == "on its scale it cannot be that the bar is a standard error"
    extremes = [0.0, 1.0] * 5
    assert PublishedMean(0.5, None, 10, UNIT).allows(statistics.stdev(extremes))
    assert not PublishedMean(0.5, None, 10, UNIT).allows(statistics.stdev(extremes) * 1.001)


@pytest.mark.parametrize(("solved", "answer"), [(10, "inside"), (7, "inside"), (6, "outside"), (0, "outside")])
def test_at_the_end_of_a_scale_the_trials_there_are_counted(solved: int, answer: str) -> None:
    ours = [1.0] * solved + [0.999] * (10 - solved)
    assert repetition(PublishedMean(1.0, None, 10, UNIT), ours, 10).answer == answer


def test_a_number_without_a_spread_is_compared_by_ours() -> None:
    published = PublishedMean(3.0, None, 10, (0.0, 7.0), precision=0.5)
    assert repetition(published, [1.5, 1.7] * 5, 10).answer is Answer.OUTSIDE
    assert repetition(published, [2.4, 2.6] * 5, 10).answer is Answer.INSIDE
    nothing = repetition(published, [3.0] * 10, 10)
    assert (nothing.answer, nothing.reason) == (Answer.UNKNOWN, "no spread is published, and ours is 0")
    assert repetition(PublishedMean(0.4, 0.0, 10, UNIT), [0.4] * 10, 10).answer is Answer.UNKNOWN


@pytest.mark.parametrize(
    ("ours", "broken", "reason"),
    [
        ([], 0, "not run"),
        ([3.0] * 4, 0, "4 of our trials, at least 5 are needed"),
        ([3.0] * 8, 2, "2 of our 10 trials gave no number"),
    ],
)
def test_without_enough_trials_the_interval_is_for_as_many_as_planned(
    ours: list[float], broken: int, reason: str
) -> None:
    found = repetition(PublishedMean(3.0, 1.0, 10), ours, 10, broken)
    assert (found.answer, found.reason) == (Answer.UNKNOWN, reason)
    assert _of(found, Spread.DEVIATION).high == pytest.approx(3.0 + 2.262157 * math.sqrt(0.2), abs=1e-6)


def _agreement(mean: float, ours: list[float], trials: int = 10, error: float | None = 1.0) -> Agreement:
    found = repetition(PublishedMean(mean, error, trials), ours, 10)
    return found.agreement


@pytest.mark.parametrize(("true", "n"), [(0.0, 10), (detectable_shift(10), 10), (detectable_shift(10), 50)])
def test_a_mean_at_the_margin_is_seldom_found_consistent(true: float, n: int) -> None:
    """At the margin at most 5 of 100, by the reading that is true; ten trials of ours never suffice."""
    rng = np.random.default_rng(40)
    consistent = 0
    for theirs, ours in zip(rng.normal(0, 1, (DRAWN, 10)), rng.normal(true, 1, (DRAWN, n)), strict=True):
        found = repetition(PublishedMean(float(theirs.mean()), statistics.stdev(theirs), 10), [*map(float, ours)], 10)
        needed = _of(found, Spread.DEVIATION).needed
        consistent += needed is not None and needed <= n
    assert consistent / DRAWN <= (0 if n == 10 else 0.06)


def test_the_trials_that_would_show_equivalence_just_do() -> None:
    found = repetition(PublishedMean(0.0, 1.0, 10), [0.1] * 10, 10)
    needed = _of(found, Spread.DEVIATION).needed
    assert needed is not None
    for n, enough in ((needed, True), (needed - 1, False)):
        half = student.ppf(0.95, 9) * math.sqrt(1 / 10 + 1 / n)
        assert bool(0.1 + half <= detectable_shift(10)) is enough


@pytest.mark.parametrize(("there", "agreement"), [(10, "consistent"), (8, "uninformative"), (6, "contradicted")])
def test_a_mean_at_the_end_of_its_scale_is_consistent_where_a_detectable_share_is_excluded(
    there: int, agreement: str
) -> None:
    ours = [1.0] * there + [0.5] * (10 - there)
    assert repetition(PublishedMean(1.0, 0.0, 10, UNIT), ours, 10).agreement == agreement


def test_the_detectable_share_is_what_fishers_test_of_ten_against_ten_finds_one_time_in_three() -> None:
    rejected = [k for k in range(11) if fisher_exact([[10, 0], [k, 10 - k]]).pvalue <= 0.05]
    assert binom.pmf(rejected, 10, detectable_share(10)).sum() == pytest.approx(1 / 3)


def test_several_numbers_are_inside_together_in_95_of_100_repetitions() -> None:
    rng = np.random.default_rng(5)
    outside = 0
    for theirs, ours in zip(*rng.normal(0, 1, (2, 500, 5, 10)), strict=True):
        outside += any(
            _of(
                repetition(PublishedMean(float(x.mean()), statistics.stdev(x), 10), [*map(float, y)], 10, among=5),
                Spread.DEVIATION,
            ).answer
            is Answer.OUTSIDE
            for x, y in zip(theirs, ours, strict=True)
        )
    assert outside / 500 <= 0.05 + 3 * math.sqrt(0.05 * 0.95 / 500)


def test_without_enough_published_trials_nothing_is_consistent() -> None:
    assert _agreement(0.0, [0.0, 0.1] * 5, trials=3) is Agreement.UNINFORMATIVE
    assert _agreement(0.0, [], trials=10) is Agreement.OPEN
