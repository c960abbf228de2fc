"""The smallest effect that a paper's own design could have detected: Simonsohn's "small telescopes" (2015)."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

POWER: Final = 1 / 3
"""Simonsohn's: an effect that a design detects less often than this is one that the design could not study."""

ALPHA: Final = 0.05
"""Of the two-sided rank test that is taken for the paper's."""


@lru_cache
def detectable_a12(n: int) -> float:
    """Return the A12 that a two-sided rank test of `n` against `n` trials detects with power 1/3, to two digits.

    The alternatives are Lehmann's (1953): F_A is a power of F_B, so that the exact power has a closed form. Two normal
    distributions give the same two digits.

    Args:
        n: trials a side, at least 4: fewer detect nothing at 0.05.
    """
    null = _u_distribution(n, 1.0)
    tail = null[::-1].cumsum()[::-1]
    if tail[-1] > ALPHA / 2:
        raise ValueError(f"A two-sided rank test of {n} against {n} trials never reaches {ALPHA:g}: 4 or more do.")
    least = int(np.argmax(tail <= ALPHA / 2))
    low, high = 0.5, 1.0
    while round(low, 2) != round(high, 2):
        a12 = (low + high) / 2
        chances = _u_distribution(n, a12 / (1 - a12))
        power = chances[least:].sum() + chances[: len(chances) - least].sum()
        low, high = (a12, high) if power < POWER else (low, a12)
    return round(low, 2)


@lru_cache
def comparison_power(n: int, alpha: float, a12: float) -> float:
    """Return the probability that the one-sided rank test of `n` against `n` trials without ties rejects at `alpha`.

    The alternatives are Lehmann's, as in `detectable_a12`; `a12` is strictly between 0 and 1.
    """
    tail = _u_distribution(n, 1.0)[::-1].cumsum()[::-1]
    return float(_u_distribution(n, a12 / (1 - a12))[tail <= alpha].sum())


def _u_distribution(n: int, odds: float) -> NDArray[np.float64]:
    """Return the distribution of U = number of pairs in which A is larger, shape [n² + 1], for F_A = F_B ** odds.

    The largest of i values of A and j of B is one of A with probability i · odds / (i · odds + j), and what is left is
    of the same form (Savage 1956); a largest value of A is above all j of B that are left.
    """
    size = n * n + 1
    ways = np.zeros((n + 1, n + 1, size))
    ways[n, n, 0] = 1.0
    for i in range(n, -1, -1):
        for j in range(n, -1, -1):
            if i:
                ways[i - 1, j, j:] += i * odds / (i * odds + j) * ways[i, j, : size - j]
            if j:
                ways[i, j - 1] += j / (i * odds + j) * ways[i, j]
    found: NDArray[np.float64] = ways[0, 0]
    return found
