"""How many steps one device call takes, and how often a checkpoint is written."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

CALL_SECONDS: Final = 1.0
"""Approximate length of one device call: a checkpoint can only be written after one."""

AFFORDED: Final = 0.03
"""Seconds that a checkpoint may take per second between two checkpoints; slower ones are written less often."""


class Strides:
    """How many steps to run per device call: one at first, then as many as the last call's speed allows.

    Attributes:
        seconds: duration of the last call.
    """

    def __init__(self) -> None:
        """Start without a measured speed."""
        self.seconds = 0.0
        self._per_step = math.inf

    def after(self, reached: int, until: int) -> int:
        """Return the step to run to from step `reached`, at most `until`."""
        return min(until, reached + max(int(CALL_SECONDS / self._per_step), 1))

    def seconds_for(self, steps: int) -> float | None:
        """Return how long `steps` steps will take; None before the first call."""
        return None if math.isinf(self._per_step) else steps * self._per_step

    def took(self, steps: int, seconds: float) -> None:
        """Measure the speed from a call of `steps` steps (at least one)."""
        self.seconds = seconds
        self._per_step = max(seconds, 1e-9) / steps


class Rhythm:
    """When the next checkpoint is due: some seconds after the last one, or later if writing is slow."""

    def __init__(self, seconds: float) -> None:
        """Begin now; `seconds` is the time between two cheap checkpoints, 0 for one after every call."""
        self._seconds = seconds
        self._cost = 0.0
        self._last = time.monotonic()

    @property
    def due(self) -> bool:
        """Whether a checkpoint is due."""
        return time.monotonic() - self._last >= self._seconds * max(1.0, self._cost / AFFORDED)

    @contextmanager
    def saving(self) -> Iterator[None]:
        """Time the writing of a checkpoint."""
        began = time.monotonic()
        yield
        self._last = time.monotonic()
        self._cost = self._last - began
