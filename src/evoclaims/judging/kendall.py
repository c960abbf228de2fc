"""The exact test for a trend over levels: Kendall's S of each trial, summed over independent trials."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from itertools import combinations
from typing import Literal, get_args

from evoclaims.judging.counting import Counts, digit_width
from evoclaims.judging.exact import ExactTest

Slope = Literal["falls", "rises"]


def trend_test(profiles: Sequence[Sequence[float]], direction: Slope) -> ExactTest:
    """Test whether values fall (or rise) with the level, within trials.

    The statistic is the sum over trials of Kendall's S against the level index. Under the null a trial's values are
    exchangeable over its levels, independently of the other trials. S is the number of untied pairs minus twice the
    inversions, and the inversions of a random arrangement of a multiset follow the Gaussian multinomial coefficient
    (MacMahon 1913), so the null is exact, ties included, without enumeration.

    Args:
        profiles: one row per trial, shape [n, levels]; infinities rank as such.
        direction: "falls" or "rises".

    Raises:
        ValueError: without trials, for rows of unequal length or fewer than two levels, or for NaN.
    """
    if direction not in get_args(Slope):
        raise ValueError(f"No direction {direction!r}; known: {', '.join(get_args(Slope))}.")
    if len({len(row) for row in profiles}) != 1 or len(profiles[0]) < 2:
        raise ValueError("A trend test needs at least one trial, and the same two or more levels in each.")
    if any(math.isnan(value) for row in profiles for value in row):
        raise ValueError("A trend test cannot rank NaN.")
    rows = [tuple(row) if direction == "falls" else tuple(reversed(row)) for row in profiles]
    # The order of the tie groups does not change the coefficient: sort them for more cache hits.
    patterns = tuple(sorted(tuple(sorted(Counter(row).values())) for row in rows))
    inversions = _inversions(patterns)
    observed = sum(earlier > later for row in rows for earlier, later in combinations(row, 2))
    return ExactTest(p=inversions.tail(observed), attainable_p=inversions.tail(inversions.largest))


def trend_attainable(n: int, levels: int) -> float:
    """Return the smallest one-sided p for `n` trials over `levels` levels without ties: 1 / (levels!)^n."""
    return 1.0 / math.factorial(levels) ** n if n * math.lgamma(levels + 1) < 700 else 0.0


@lru_cache(maxsize=256)
def _inversions(patterns: tuple[tuple[int, ...], ...]) -> Counts:
    """Count the arrangements by their inversions in all trials, given each trial's tie group sizes."""
    arrangements = {
        sizes: math.factorial(sum(sizes)) // math.prod(map(math.factorial, sizes)) for sizes in set(patterns)
    }
    total = math.prod(arrangements[sizes] for sizes in patterns)
    width = digit_width(total)
    packed = 1
    for sizes, trials in Counter(patterns).items():
        packed *= _gaussian_multinomial(sizes, width) ** trials
    return Counts(packed, width, total)


def _gaussian_multinomial(sizes: tuple[int, ...], width: int) -> int:
    """Return [sum(sizes)]! / prod [size]! in q-factorials, at q = 2**width: digit d counts arrangements.

    The quotient is a polynomial in q whose coefficient of q^d is the number of arrangements with d inversions.
    """
    return _q_factorial(sum(sizes), width) // math.prod(_q_factorial(size, width) for size in sizes)


def _q_factorial(k: int, width: int) -> int:
    """Return [1][2]...[k] with [i] = 1 + q + ... + q^(i-1), at q = 2**width."""
    product, bracket = 1, 0
    for _ in range(k):
        bracket = (bracket << width) | 1
        product *= bracket
    return product
