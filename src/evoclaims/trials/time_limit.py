"""The time limit of a batch of trials: how it is written, and which records it makes outdated."""

from __future__ import annotations

import math
import re
from typing import Final

from evoclaims.core.errors import UserError
from evoclaims.trials import crashes
from evoclaims.trials.result import TrialResult

DEFAULT_LIMIT: Final = "24h"
"""Long enough for every condition of the full tier on its intended hardware."""

_UNITS: Final = {"s": 1.0, "min": 60.0, "h": 3600.0}


def seconds_of(text: str) -> float:
    """Return a duration such as "90s", "30min", "1.5h" in seconds; infinity for "none".

    Raises:
        UserError: for any other text, or a duration of 0.
    """
    if text.strip() == "none":
        return math.inf
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(s|min|h)\s*", text, re.ASCII)
    if found is None or float(found[1]) == 0:
        raise UserError(f'A time limit is a length of time such as "90s", "30min" or "24h", or "none", not {text!r}.')
    return float(found[1]) * _UNITS[found[2]]


def is_final(result: TrialResult | None) -> bool:
    """Whether there is a trial, which did not time out, nor crash in another process: this one tries that again."""
    return result is not None and result.status != "timeout" and not crashes.is_of_another_process(result)


def answers(result: TrialResult | None, limit: float) -> bool:
    """Whether a trial need not be run under a limit of `limit` seconds.

    A timed-out trial is run again only under a larger limit.
    """
    return is_final(result) or (result is not None and limit <= time_allowed(result))


def time_allowed(result: TrialResult) -> float:
    """Return the time limit of a timed-out trial's batch in seconds; 0 if its record does not say."""
    return float(result.timing.get("limit", 0.0))
