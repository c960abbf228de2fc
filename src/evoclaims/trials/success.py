"""What a success is: a share from 0 to 1, whoever says it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from evoclaims.core.errors import UserError

SHARES: Final = ("mean_success", "last_success")
"""Names of a result's metrics that are successes."""

_ROUNDING: Final = 1e-6
"""What is so close to 1 and not 1 is a mean of ones, rounded."""


def is_share(number: float) -> bool:
    """Whether a finite number is a success: a share from 0 to 1, which a mean of ones may exceed by rounding."""
    return 0.0 <= number <= 1.0 + _ROUNDING


def check_success(
    what: str,
    *successes: float,
    name: str = "success",
    solves: bool = True,
    advice: str = "make the task's or the method's success such a share",
) -> None:
    """Check that successes are shares; those that are not finite are divergence, which is judged elsewhere.

    Args:
        what: reports them, such as "The examination of cma_es on n_parity".
        successes: of any number of levels or reports.
        name: of the metric or curve.
        solves: whether a level is solved by one that is exactly 1.
        advice: what to do, as the end of a sentence.

    Raises:
        UserError: when one is not.
    """
    rounded = [success for success in successes if 0.0 < abs(success - 1.0) <= _ROUNDING]
    if rounded and solves:
        raise UserError(
            f"{what} reports a {name} of {rounded[0]!r}, which is 1 except for rounding, and a level is "
            "solved at exactly 1. Average episodes by evoclaims.envs.averaged, or shares by "
            "evoclaims.envs.share."
        )
    wrong = [success for success in successes if math.isfinite(success) and not is_share(success)]
    if wrong:
        raise UserError(
            f"{what} reports a {name} of {wrong[0]:g}. A success is a share from 0 to 1, and a level is solved at "
            f"exactly 1: {advice}."
        )


def check_shares(what: str, metrics: Mapping[str, float], advice: str) -> None:
    """Check the metrics that are successes; arguments and errors are those of `check_success`."""
    for name in SHARES:
        if name in metrics:
            check_success(what, metrics[name], name=name, solves=False, advice=advice)
