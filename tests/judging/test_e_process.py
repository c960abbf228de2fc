"""Evidence over nights: no more false alarms than it promises, and soon found where something has changed."""

from __future__ import annotations

import itertools
from collections import Counter

import numpy as np
import pytest
from scipy.stats import binom, norm

from evoclaims.judging.e_process import (
    SHIFTS,
    evidence,
    evidence_against_constant,
    nights_to_find,
    ranks_of_new,
    standardized_ranks,
)

RUNS, NIGHTS, EACH, BEFORE = 1000, 30, 10, 60


def of_runs(scores, before=BEFORE):  # type: ignore[no-untyped-def]
    """Return the evidence of runs, shape [runs, nights]."""
    new = scores.shape[-1] - before
    p = ranks_of_new(scores, np.random.default_rng(1).random((*scores.shape[:-1], new)))
    return evidence(p, before, [EACH] * (new // EACH))


def test_ranks_of_exchangeable_trials_are_uniform_and_independent() -> None:
    """Each tuple of ranks comes from equally many of all orders of five scores, two of them of references."""
    orders = np.array(list(itertools.permutations(range(5))), np.float64)
    ranks = np.floor(ranks_of_new(orders, np.full((len(orders), 3), 0.5)) * np.array([3, 4, 5]))
    assert Counter(map(tuple, ranks.tolist())) == dict.fromkeys(itertools.product(range(3), range(4), range(5)), 2)


def test_ties_share_the_ranks_between_their_neighbours() -> None:
    scores = np.array([0.0, 1, 1, 2, 1])
    assert ranks_of_new(scores, np.array([0.0]))[0] == pytest.approx(1 / 5)
    assert ranks_of_new(scores, np.array([0.5]))[0] == pytest.approx(2.5 / 5)
    assert ranks_of_new(np.zeros(5), np.array([0.25, 0.75])) == pytest.approx([0.25, 0.75])


@pytest.mark.parametrize("kind", ["normal", "a tenth is 1"])
def test_a_thousand_months_without_a_change_have_few_alarms(kind: str) -> None:
    rng = np.random.default_rng(20251126)
    scores = rng.normal(size=(RUNS, BEFORE + NIGHTS * EACH))
    if kind != "normal":
        scores = (scores > 1.28).astype(float)
    highest = of_runs(scores).max(axis=1)
    for level in (4, 20, 100):
        assert (highest >= level).sum() <= binom.ppf(0.999, RUNS, 1 / level)


def test_evidence_is_the_mixture_of_bets_by_first_night_and_shift() -> None:
    rng, sizes = np.random.default_rng(3), [2, 1, 3]
    p = rng.random(6)
    starts, ends = np.cumsum([0, *sizes[:-1]]), np.cumsum(sizes)
    for last, found in enumerate(evidence(p, 5, sizes)):
        total = 1 / (last + 2)
        for night in range(last + 1):
            for shift in SHIFTS:
                product = 1.0
                for at in range(starts[night], ends[last]):
                    bet = shift * (5 + starts[night]) / (5 + at)
                    product *= norm.pdf(norm.ppf(p[at]), bet) / norm.pdf(norm.ppf(p[at]))
                total += product / len(SHIFTS) / ((night + 1) * (night + 2))
        assert found == pytest.approx(total)


def test_a_change_is_found_in_both_directions_and_after_quiet_nights() -> None:
    """Five conditions that move by 0.5 SD each move their sum by √5 times as much."""
    level = 2 * 25 / 0.05  # of the sum of a method, among 25 families
    for shift in (0.5 * 5**0.5, -0.5 * 5**0.5):
        assert nights_to_find(BEFORE, EACH, shift, level) <= 3
    assert nights_to_find(BEFORE, EACH, 0.8 * 5**0.5, level) <= 2
    assert nights_to_find(BEFORE, EACH, 0.0, level, most=3) == 4
    quiet = 30
    scores = np.random.default_rng(5).normal(size=(100, BEFORE + (quiet + 5) * EACH))
    scores[:, BEFORE + quiet * EACH :] += 0.5 * 5**0.5
    reached = of_runs(scores) >= level
    assert not reached[:, :quiet].any()
    assert np.median(reached.argmax(axis=1) + 1 - quiet) <= 4


def test_evidence_against_a_constant_is_a_ratio_of_likelihoods() -> None:
    """By sums over a fine grid of probabilities instead of closed forms."""
    q = (np.arange(100_000) + 0.5) / 100_000
    nights = [(0, 2), (1, 3), (2, 2)]
    for last in range(1, 4):
        odd = sum(night[0] for night in nights[:last])
        all_new = sum(night[1] for night in nights[:last])
        null = (q**odd * (1 - q) ** (9 + all_new - odd)).max()
        mixture = 1 / (last + 1) if not odd else 0.0
        for start in range(last):
            if not sum(night[0] for night in nights[:start]):
                k, n = (sum(night[part] for night in nights[start:last]) for part in (0, 1))
                mixture += (q**k * (1 - q) ** (n - k)).mean() / ((start + 1) * (start + 2))
        assert evidence_against_constant(10, nights)[last - 1] == pytest.approx(mixture / null, rel=1e-4)


@pytest.mark.parametrize("rate", [0.003, 0.01, 0.03])
def test_rare_other_values_after_constant_references_raise_few_alarms(rate: float) -> None:
    runs, nights = 300, 10
    odd = np.random.default_rng(7).random((runs, BEFORE - 1 + nights * EACH)) < rate
    highest = [
        max(evidence_against_constant(BEFORE, [(int(night.sum()), EACH) for night in run.reshape(nights, EACH)]))
        for run in odd[~odd[:, : BEFORE - 1].any(axis=1), BEFORE - 1 :]
    ]
    for level in (4, 20):
        assert (np.array(highest) >= level).sum() <= binom.ppf(0.999, runs, 1 / level)


def test_standardized_ranks_of_equal_values_are_zero() -> None:
    assert standardized_ranks(np.ones(4)).tolist() == [0, 0, 0, 0]
    assert standardized_ranks(np.array([3.0, 1, 2])) == pytest.approx(np.array([1, -1, 0]) * 1.5**0.5)
