"""How far and how finely a measure is observed: what lies beyond is only known to lie beyond."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Final

from evoclaims.core.errors import UserError


def product(factor: float, value: float) -> float:
    """Return the product: 0.1 times 3 is 0.3."""
    return float(_written(factor) * _written(value))


def total(value: float, other: float) -> float:
    """Return the sum: 0.1 and 0.2 make 0.3."""
    return float(_written(value) + _written(other))


def _written(value: float) -> Decimal:
    """Return the shortest decimal number that is read as this float."""
    return Decimal(repr(float(value)))


_ROUNDING: Final = 1e-9
"""A share of a step that floating-point numbers may be off by."""


@dataclass(frozen=True)
class Window:
    """The part of a scale in which values are observed.

    Attributes:
        limit: a larger value is only known to be larger (it is censored), and counts as infinite.
        every: a value is only known up to a multiple of this, and counts as the next one; 0 for exact values.
        as_reported: a value that is no multiple counts as it is, unless a window that is shared makes it coarser.
        steps: of reports that are the same in all trials; empty where nobody knows, or where they are multiples.
    """

    limit: float = math.inf
    every: float = 0.0
    as_reported: bool = False
    steps: tuple[float, ...] = ()

    def seen(self, value: float) -> float:
        """Return what is known of a value."""
        if value > self.limit:
            return math.inf
        if not self.every or self.as_reported or math.isinf(value):
            return value
        return min(math.ceil(value / self.every - _ROUNDING) * self.every, self.limit)

    def shows(self, before: float, value: float) -> bool:
        """Whether numbers above `before`, up to `value`, are seen alike, or lie between two reports of all trials."""
        if self.as_reported:
            return bool(self.steps)
        return self.seen(before + 2 * _ROUNDING * self.every) == self.seen(value)

    def scaled(self, factor: float) -> Window:
        """Return the window of values that are multiplied by a factor above 0."""
        return Window(product(factor, self.limit), product(factor, self.every), self.as_reported)


def shared(windows: Sequence[Window]) -> Window:
    """Return the window in which values of all of `windows` can be ranked: the shortest and the coarsest.

    What only one of two windows distinguishes is then equal, or beyond the limit, in both: values of one distribution
    stay exchangeable, and rank tests exact. Of two samples with a limit each it is Gehan's order (1965): a pair of
    which nobody knows which is larger is a tie.

    Raises:
        UserError: when the coarsest is no multiple of another one, or none of its multiples is below the limit.
    """
    if len(set(windows)) == 1 and (windows[0].steps or not windows[0].as_reported):
        return windows[0]
    every, limit = max(window.every for window in windows), min(window.limit for window in windows)
    if every:
        # Between the last multiple and the limit, a coarse measure knows nothing but that a value is beyond the former.
        limit = math.floor(limit / every + _ROUNDING) * every if math.isfinite(limit) else limit
        finer = [window.every for window in windows if window.every]
        if not limit or any(abs(every / one - round(every / one)) > _ROUNDING for one in finer):
            raise UserError(
                "These measures are known to multiples of "
                f"{' and '.join(f'{one:,.12g}' for one in finer)} up to "
                f"{min(window.limit for window in windows):,.12g}, which a rank test cannot compare. Give "
                "the conditions budgets with reports equally far apart (one number of environment_steps, "
                "a multiple of reports × cost of each method), or one report after each step of the "
                "method."
            )
    return Window(limit, every)


EVERYTHING = Window()
"""Of a measure whose values are all observed exactly."""
