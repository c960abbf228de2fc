"""Exact counts as polynomials packed into one integer: coefficient k is digit k in a huge base.

With a base above every coefficient, adding and multiplying the packed integers adds and multiplies the polynomials
(Kronecker's substitution); with Python's integers this is exact and fast.
"""

from __future__ import annotations

from itertools import accumulate

MAX_TRIALS = 100
"""Maximum trials per side for the exact counts (about a second at 100 against 100)."""


def digit_width(total: int) -> int:
    """Return the bits per digit for counts up to `total`, rounded up to whole bytes."""
    return 8 * (total.bit_length() // 8 + 1)


def unpack(packed: int, width: int, length: int) -> list[int]:
    """Return the `length` lowest coefficients of a polynomial packed with `width` bits per digit (whole bytes)."""
    size = width // 8
    data = packed.to_bytes(size * length, "little")
    return [int.from_bytes(data[start : start + size], "little") for start in range(0, size * length, size)]


def upper_tails(counts: list[int]) -> tuple[float, ...]:
    """Return P(X >= k) for every k, where X = k in `counts[k]` of equally likely cases."""
    total = sum(counts)
    # Division of Python integers rounds correctly, so 1 in 20 is the float 0.05 and compares equal to it.
    return tuple(tail / total for tail in reversed(list(accumulate(reversed(counts)))))
