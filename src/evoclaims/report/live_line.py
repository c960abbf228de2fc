"""A progress line of a run: rewritten in place on a terminal, printed now and then in a log.

Rich's live displays write nothing to a log before they end, and hide the cursor, which a killed process leaves hidden.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

from evoclaims.core.printable import printable
from evoclaims.trials.progress import RunProgress

LOG_SECONDS: Final = 10.0
"""Least time between two lines of a log about the same condition."""


class LiveLine:
    """A watcher of runs that draws the progress line."""

    def __init__(
        self, write: Callable[[str], None], columns: int | None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Draw with `write`: in place on a terminal of `columns` columns, or as a log if None."""
        self._write = write
        self._width = None if columns is None else max(columns - 1, 20)
        self._clock = clock
        self._shown = ("", "")
        self._at = -LOG_SECONDS
        self._open = False

    def __call__(self, progress: RunProgress) -> None:
        """Show the newest state."""
        if self._width is not None:
            start = "\r" if self._open else "\n"
            self._write(start + describe(progress)[: self._width].ljust(self._width))
            self._open = True
            return
        step = (progress.condition, progress.phase)
        finished = progress.trials > 0 and progress.ended == progress.trials
        if step != self._shown or finished or self._clock() - self._at >= LOG_SECONDS:
            self._write(("" if self._open else "\n") + f"  {describe(progress)}\n")
            self._shown, self._at, self._open = step, self._clock(), True

    def close(self) -> None:
        """Leave the line, so that other output starts on a fresh one."""
        if self._open and self._width is not None:
            self._write("\r" + " " * self._width + "\r")
        self._open = False


def describe(progress: RunProgress) -> str:
    """Return the line: condition, trials, step, level, best, time left; safe to print, whatever the names contain."""
    if progress.best is None:
        count = f" ({progress.trials} trials)" if progress.trials else ""
        return printable(f"{progress.condition}: {progress.phase}{count}")
    left = "" if progress.seconds_left is None else f", {duration(progress.seconds_left)} left"
    return printable(
        f"{progress.condition}: {progress.ended}/{progress.trials} trials ended, "
        f"step {progress.steps:,}/{progress.total_steps:,}, "
        f"level {progress.level} of {progress.levels - 1}, best {progress.best:.3f}{left}"
    )


def duration(seconds: float) -> str:
    """Return a length of time as people write it, such as "40 s", "3 min 20 s", "2 h 05 min"."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
