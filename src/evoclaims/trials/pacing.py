"""How much is done between two looks of the host at the device, and how often a checkpoint is written."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

CALL_SECONDS: Final = 1.0
"""About how long one call of a device takes: a checkpoint can only be written after one."""

AFFORDED: Final = 0.03
"""Seconds that a checkpoint may take for each second between two of them; dearer ones are written less often."""


class Strides:
    """How many steps to ask of a device at once: one at first, then as many as the last call's pace allows.

    Attributes:
        seconds: what the last call took.
    """

    def __init__(self) -> None:
        """Know no pace yet."""
        self.seconds = 0.0
        self._per_step = math.inf

    def after(self, reached: int, until: int) -> int:
        """Return up to where to go from `reached`, at most `until`."""
        return min(until, reached + max(int(CALL_SECONDS / self._per_step), 1))

    def seconds_for(self, steps: int) -> float | None:
        """Return how long so many steps will take; None before the first call."""
        return None if math.isinf(self._per_step) else steps * self._per_step

    def took(self, steps: int, seconds: float) -> None:
        """Learn from a call of so many steps (at least one)."""
        self.seconds = seconds
        self._per_step = max(seconds, 1e-9) / steps


class Rhythm:
    """When the next checkpoint is due: so long after the last one, and longer where writing it is dear."""

    def __init__(self, seconds: float) -> None:
        """Begin now; `seconds` lie between two checkpoints that cost little, and none for one after every call."""
        self._seconds = seconds
        self._cost = 0.0
        self._last = time.monotonic()

    @property
    def due(self) -> bool:
        """Whether it is time for one."""
        return time.monotonic() - self._last >= self._seconds * max(1.0, self._cost / AFFORDED)

    @contextmanager
    def saving(self) -> Iterator[None]:
        """Time the writing of one."""
        began = time.monotonic()
        yield
        self._last = time.monotonic()
        self._cost = self._last - began
