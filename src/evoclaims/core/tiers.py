"""The sizes at which claims are run."""

from typing import Final

TIERS: Final = ("smoke", "full")
"""Reduced budgets, and the paper's."""
