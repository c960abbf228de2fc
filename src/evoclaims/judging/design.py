"""A claim's (group-sequential) design, fixed before any trial runs: looks, significance levels, margins and seeds.

A margin is the smallest effect that the paper's own design could have detected: "small telescopes" (Simonsohn 2015).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.judging.exact import MAX_TRIALS

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


PAPER_TRIALS: Final = 10
"""Trials a side that a paper is taken to have, unless `Design.for_paper` says otherwise."""


@dataclass(frozen=True)
class Look:
    """One look at the data: after `n` trials per side, decide at significance level `alpha`."""

    n: int
    alpha: float

    def __post_init__(self) -> None:
        """Reject impossible sizes and levels."""
        if not 1 <= self.n <= MAX_TRIALS:
            raise UserError(f"A look takes 1 to {MAX_TRIALS} trials (the exact tests' range), not {self.n}.")
        if not 0 < self.alpha < 1:
            raise UserError(f"A look's alpha is {self.alpha}. Use one between 0 and 1, such as 0.05.")


THREE_LOOKS: Final = (Look(5, 0.01), Look(10, 0.04), Look(30, 0.0095))
"""A verdict at five or ten trials is the same as by the first two looks alone; see `COMPUTED` for the third."""

COMPUTED: Final[Mapping[tuple[Look, ...], float]] = {THREE_LOOKS: 0.05}
"""Rates of looks that their union bound overstates.

The trials of a look are among those of the next, so errors coincide. For normal statistics, each with its whole α, the
three looks err with 0.0498 (correlations √(n/m)); of the tests here, on lattices and with ties, each errs less.
"""


@dataclass(frozen=True)
class Design:
    """The statistical design that a claim is judged by.

    Attributes:
        looks: sorted by rising n.
        p0: the probability of success that "solves" and "stays" must exceed.
        a12_margin: the size that a comparison claims, as Vargha and Delaney's A12: what the paper's own design detects
            with power 1/3 (see `for_paper`).
        first_seed: trials that are run use the seeds first_seed, first_seed + 1, ...; imported ones count from 0.
    """

    looks: tuple[Look, ...]
    p0: float = 0.7
    a12_margin: float = field(default_factory=lambda: detectable_a12(PAPER_TRIALS))
    first_seed: int = 0

    def __post_init__(self) -> None:
        """Reject impossible designs."""
        if not self.looks:
            raise UserError("A design needs at least one look, such as Look(n=10, alpha=0.05).")
        if any(later.n <= earlier.n for earlier, later in pairwise(self.looks)):
            sizes = ", ".join(str(look.n) for look in self.looks)
            raise UserError(f"The looks take {sizes} trials. Each look must take more than the one before.")
        if self.alpha >= 1:
            raise UserError(f"The alphas of all looks add up to {self.alpha:g}. Their sum must be below 1.")
        if not 0 < self.p0 < 1:
            raise UserError(f"p0 is {self.p0}. It must be above 0 and below 1 (default 0.7).")
        if not 0.5 <= self.a12_margin < 1:
            raise UserError(f"The A12 margin is {self.a12_margin}. It must be at least 0.5 and below 1 (default 0.71).")
        if self.first_seed < 0:
            raise UserError(f"The first seed is {self.first_seed}. It must be at least 0.")

    @property
    def alpha(self) -> float:
        """The false-positive rate over all looks: by the union bound, or as it has been computed."""
        return COMPUTED.get(self.looks, sum(look.alpha for look in self.looks))

    @property
    def last(self) -> Look:
        """The last look, which takes the most trials."""
        return self.looks[-1]

    def seeds(self, n: int, imported: bool = False) -> tuple[int, ...]:
        """Return the seeds of the first `n` trials of a condition that is run, or of one that is imported."""
        first = 0 if imported else self.first_seed
        return tuple(range(first, first + n))

    def for_paper(self, trials: int) -> Design:
        """Return the design with the margin for a paper that compares `trials` trials per side (Simonsohn 2015).

        Raises:
            UserError: for fewer than 4 or more than the exact tests' number of trials.
        """
        if not 4 <= trials <= MAX_TRIALS:
            raise UserError(
                f"A paper's comparison has 4 to {MAX_TRIALS} trials per side, not {trials}. Set a12_margin instead."
            )
        return replace(self, a12_margin=detectable_a12(trials))

    def with_third_look(self) -> Design:
        """Return the design with a look at thirty trials after those at five and ten, which stay as they are.

        Other designs have spent their α by their last look, and stay: so does the smoke tier's.
        """
        return replace(self, looks=THREE_LOOKS) if self.looks == THREE_LOOKS[:2] else self

    @staticmethod
    def fixed(n: int, alpha: float = 0.05) -> Design:
        """Return the design with a single look at `n` trials."""
        return Design(looks=(Look(n, alpha),))


FIXED_10 = Design.fixed(10)
"""The paper's ten trials in a single look."""

SEQUENTIAL = Design(looks=THREE_LOOKS[:2])
"""Five trials, and five more if those leave the claim open."""
