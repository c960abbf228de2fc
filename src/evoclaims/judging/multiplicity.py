"""Holm's correction, for claims joined by "or" and for gates over a whole suite."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache


def holm(ps: Sequence[float]) -> tuple[float, ...]:
    """Return the Holm-adjusted p of each of `ps`: reject those at most alpha, with familywise error alpha."""
    return _holm(tuple(ps)) if len(ps) else ()


@lru_cache(maxsize=1024)
def _holm(ps: tuple[float, ...]) -> tuple[float, ...]:
    """Return the adjusted p; cached, since statsmodels collects garbage in every call (tens of milliseconds)."""
    from statsmodels.stats.multitest import multipletests  # a second, in which it imports pandas

    return tuple(float(p) for p in multipletests(list(ps), method="holm")[1])
