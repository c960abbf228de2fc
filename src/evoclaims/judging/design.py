"""A claim's (group-sequential) design, fixed before any trial runs: looks, significance levels, margins and seeds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Final

from evoclaims.core.errors import UserError
from evoclaims.judging.exact import MAX_TRIALS
from evoclaims.judging.telescope import detectable_a12

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
        first_seed: trials use the seeds first_seed, first_seed + 1, ...
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

    def seeds(self, n: int) -> tuple[int, ...]:
        """Return the seeds of the first `n` trials."""
        return tuple(range(self.first_seed, self.first_seed + n))

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
