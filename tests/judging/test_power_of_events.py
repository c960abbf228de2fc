"""The power of "in most trials" is that of the judge, over every outcome of the trials."""

from __future__ import annotations

import itertools
from math import prod

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.judging.design import SEQUENTIAL, Look
from evoclaims.judging.exact import binomial_test
from evoclaims.judging.power import event_power


def _by_enumeration(looks: list[Look], p0: float, rate: float) -> float:
    """Return the power by going through every sequence of trials, one by one."""
    supported = 0.0
    for outcomes in itertools.product((True, False), repeat=looks[-1].n):
        for look in looks:
            held = sum(outcomes[: look.n])
            above, below = (binomial_test(held, look.n, p0, side).p <= look.alpha for side in ("greater", "less"))
            if above or below:
                supported += above * prod(rate if one else 1 - rate for one in outcomes)
                break
    return supported


@given(
    st.sets(st.integers(1, 9), min_size=1, max_size=3),
    st.lists(st.sampled_from([0.01, 0.05, 0.2, 0.3]), min_size=3, max_size=3),
    st.sampled_from([0.3, 0.5, 0.7]),
    st.sampled_from([0.05, 0.5, 0.8, 0.95]),
)
def test_power_over_looks_is_that_of_every_sequence(
    sizes: set[int], alphas: list[float], p0: float, rate: float
) -> None:
    looks = [Look(n, alpha) for n, alpha in zip(sorted(sizes), alphas, strict=False)]
    assert event_power(looks, p0, rate) == pytest.approx(_by_enumeration(looks, p0, rate))


def test_ten_of_ten_at_a_rate_of_nine_in_ten_is_seldom() -> None:
    assert event_power(SEQUENTIAL.looks, 0.7, 0.9) == pytest.approx(0.9**10)
