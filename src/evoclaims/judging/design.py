"""A claim's (group-sequential) design, fixed before any trial runs: looks, significance levels, margins and seeds."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from evoclaims.core.errors import UserError
from evoclaims.judging.counting import MAX_TRIALS


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
            raise UserError(f"A look's alpha lies between 0 and 1 (such as 0.05), unlike {self.alpha}.")


@dataclass(frozen=True)
class Design:
    """The statistical design that a claim is judged by.

    Attributes:
        looks: sorted by rising n; their alphas add up to the false-positive rate (a union bound).
        p0: the probability of success that "solves" and "stays" must exceed.
        a12_margin: the effect that "greater" declares, as Vargha and Delaney's A12.
        first_seed: trials use the seeds first_seed, first_seed + 1, ...
    """

    looks: tuple[Look, ...]
    p0: float = 0.7
    a12_margin: float = 0.71
    first_seed: int = 0

    def __post_init__(self) -> None:
        """Reject impossible designs."""
        if not self.looks:
            raise UserError("A design needs at least one look, such as Look(n=10, alpha=0.05).")
        if any(later.n <= earlier.n for earlier, later in pairwise(self.looks)):
            sizes = ", ".join(str(look.n) for look in self.looks)
            raise UserError(f"Each look takes more trials than the one before, unlike {sizes}.")
        if self.alpha >= 1:
            raise UserError(f"The alphas of all looks add up to less than 1, not to {self.alpha:g}.")
        if not 0 < self.p0 < 1:
            raise UserError(f"p0 lies strictly between 0 and 1 (default 0.7), unlike {self.p0}.")
        if not 0.5 <= self.a12_margin < 1:
            raise UserError(f"The A12 margin lies from 0.5 to below 1 (default 0.71), unlike {self.a12_margin}.")
        if self.first_seed < 0:
            raise UserError(f"A seed is 0 or above, not {self.first_seed}.")

    @property
    def alpha(self) -> float:
        """The false-positive rate over all looks, by the union bound."""
        return sum(look.alpha for look in self.looks)

    @property
    def last(self) -> Look:
        """The last look, which takes the most trials."""
        return self.looks[-1]

    def seeds(self, n: int) -> tuple[int, ...]:
        """Return the seeds of the first `n` trials."""
        return tuple(range(self.first_seed, self.first_seed + n))

    @staticmethod
    def fixed(n: int, alpha: float = 0.05) -> Design:
        """Return the design with a single look at `n` trials."""
        return Design(looks=(Look(n, alpha),))


FIXED_10 = Design.fixed(10)
"""The paper's ten trials in a single look."""

SEQUENTIAL = Design(looks=(Look(5, 0.01), Look(10, 0.04)))
"""Five trials, and five more if those leave the claim open."""
