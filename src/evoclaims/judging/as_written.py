"""Sums and products of numbers as they are written in decimals, so that what is equal on paper is a tie."""

from __future__ import annotations

from decimal import Decimal


def product(factor: float, value: float) -> float:
    """Return the product: 0.1 times 3 is 0.3."""
    return float(_written(factor) * _written(value))


def total(value: float, other: float) -> float:
    """Return the sum: 0.1 and 0.2 make 0.3."""
    return float(_written(value) + _written(other))


def _written(value: float) -> Decimal:
    """Return the shortest decimal number that is read as this float."""
    return Decimal(repr(float(value)))
