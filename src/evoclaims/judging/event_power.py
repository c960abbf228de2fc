"""The power of "in most trials": how often an event with a given rate is supported by a design, exactly."""

from __future__ import annotations

from collections.abc import Sequence
from math import comb
from typing import Final

from evoclaims.judging.design import Look
from evoclaims.judging.exact import binomial_test

RATES: Final = (0.8, 0.9, 0.95)
"""Rates of an event for which its power is shown."""


def event_power(looks: Sequence[Look], p0: float, rate: float) -> float:
    """Return the probability that an event with this rate is supported in most trials (against `p0`).

    Exact: a look that supports or refutes ends it, others leave it open.
    """
    open_, before, supported = {0: 1.0}, 0, 0.0
    for look in looks:
        more, grown = look.n - before, dict[int, float]()
        for held, chance in open_.items():
            for k in range(more + 1):
                grown[held + k] = grown.get(held + k, 0.0) + chance * comb(more, k) * rate**k * (1 - rate) ** (more - k)
        open_ = {}
        for held, chance in grown.items():
            if binomial_test(held, look.n, p0, "greater").p <= look.alpha:
                supported += chance
            elif binomial_test(held, look.n, p0, "less").p > look.alpha:
                open_[held] = chance
        before = look.n
    return supported
