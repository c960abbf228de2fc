"""What a run reports to its watcher."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class RunProgress:
    """The state of a batch after a chunk.

    Attributes:
        condition: label of the condition.
        phase: "compiling", "resuming", "training" or "waiting …".
        trials: trials in the batch; `ended` of them have ended.
        steps: steps of the method taken by the furthest trial, of `total_steps`.
        best: highest success on `level`; None before the first report.
        level: highest current level of any trial, of `levels`.
        seconds_left: estimate for the batch; None while unknown.
        remark: whether the phase is a remark that is shown once and never skipped.
    """

    condition: str
    phase: str
    trials: int
    ended: int = 0
    steps: int = 0
    total_steps: int = 0
    best: float | None = None
    level: int = 0
    levels: int = 0
    seconds_left: float | None = None
    remark: bool = False


Watcher = Callable[[RunProgress], None]
"""Receives progress; must be quick and must not raise."""


def ignore(progress: RunProgress) -> None:
    """Ignore progress."""
