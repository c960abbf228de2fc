"""Trials without a result: their batch ran out of time, or their process crashed.

A crash is no outcome of a method: what was wrong has probably been mended before the next process asks for the trial.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from evoclaims.core.errors import PACKAGE_FOLDERS, UserError
from evoclaims.trials.result import TrialResult

_seen: Final = set[str]()


def remember(result: TrialResult) -> None:
    """Note that a trial has crashed here."""
    _seen.add(result.id)


def is_of_another_process(result: TrialResult) -> bool:
    """Whether a trial has crashed, and not here."""
    return result.status == "crashed" and result.id not in _seen


def why(result: TrialResult) -> str:
    """Return why a trial has crashed, in one line: the last line of its process; empty if unknown."""
    return last_said(result).rpartition("\n")[2]


def last_said(result: TrialResult) -> str:
    """Return the last output of a crashed trial's process, such as the end of a traceback; empty if not known."""
    return str(result.provenance.get("crash") or "")


def place(results: Iterable[TrialResult]) -> str:
    """Return where the first of some trials crashed, such as " (loops.py, line 10)"; empty if no traceback says so.

    That is the innermost line outside of installed packages, if there is one.
    """
    for result in results:
        lines = re.findall(r'File "([^"<]+)", line (\d+)', last_said(result))
        own = [found for found in lines if PACKAGE_FOLDERS.isdisjoint(Path(found[0]).parts)]
        if lines:
            file, line = (own or lines)[-1]
            return f" ({Path(file).name}, line {line})"
    return ""


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
    return result is not None and result.status != "timeout" and not is_of_another_process(result)


def answers(result: TrialResult | None, limit: float) -> bool:
    """Whether a trial need not be run under a limit of `limit` seconds.

    A timed-out trial is run again only under a larger limit.
    """
    return is_final(result) or (result is not None and limit <= time_allowed(result))


def time_allowed(result: TrialResult) -> float:
    """Return the time limit of a timed-out trial's batch in seconds; 0 if its record does not say."""
    return float(result.timing.get("limit", 0.0))
