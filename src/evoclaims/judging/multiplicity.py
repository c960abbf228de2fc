"""Holm's correction: where one part of a compound is enough, and for checks of a whole suite."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache


def holm(ps: Sequence[float]) -> tuple[float, ...]:
    """Return the Holm-adjusted `ps`; rejecting those of at most alpha has the familywise error alpha."""
    return _holm(tuple(ps)) if len(ps) else ()


def smallest(ps: Sequence[float]) -> float:
    """Return the smallest Holm-adjusted p, which is at most alpha if any is: the smallest times their number."""
    return min(1.0, len(ps) * min(ps))


@lru_cache(maxsize=1024)
def _holm(ps: tuple[float, ...]) -> tuple[float, ...]:
    """Return the adjusted p; cached, since statsmodels runs the garbage collector in every call (tens of ms)."""
    from statsmodels.stats.multitest import multipletests  # takes a second: it imports pandas

    return tuple(float(p) for p in multipletests(list(ps), method="holm")[1])
