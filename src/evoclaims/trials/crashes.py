"""Crashes that this process has seen: it does not run these trials again, and any other process does, once.

A crash is no outcome of a method: what was wrong has probably been mended before the next process asks for the trial.
"""

from __future__ import annotations

from typing import Final

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
