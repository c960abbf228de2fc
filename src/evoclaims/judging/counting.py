"""Exact counts as polynomials packed into one integer: coefficient k is digit k in a huge base.

With a base above every coefficient, adding and multiplying the packed integers adds and multiplies the polynomials
(Kronecker's substitution); with Python's integers this is exact and fast.
"""

from __future__ import annotations

from dataclasses import dataclass

MAX_TRIALS = 100
"""Maximum trials per side for the exact counts (about a second at 100 against 100)."""


def digit_width(total: int) -> int:
    """Return the bits per digit for counts that add up to `total`."""
    return total.bit_length() + 1


@dataclass(frozen=True)
class Counts:
    """How many of equally likely cases have X = 0, 1, 2, ...

    Attributes:
        packed: the counts, `width` bits each.
        width: see `digit_width`.
        total: number of cases.
    """

    packed: int
    width: int
    total: int

    @property
    def largest(self) -> int:
        """The largest possible X."""
        return (self.packed.bit_length() - 1) // self.width

    def tail(self, least: int) -> float:
        """Return P(X >= least), for `least` from 0 to `largest`."""
        # A number's remainder modulo its base minus one is the sum of its digits (here below the base minus one).
        cases = (self.packed >> (self.width * least)) % ((1 << self.width) - 1)
        # Division of Python integers rounds correctly, so 1 in 20 is the float 0.05 and compares equal to it.
        return cases / self.total
