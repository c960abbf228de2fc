"""A progress line of a run: rewritten in place on a terminal, printed once a minute in a log.

Rich's live displays write nothing to a log before they end, and hide the cursor, which a killed process leaves hidden.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

from evoclaims.claims.workload import Overview, Workload
from evoclaims.core.printable import printable
from evoclaims.trials.progress import RunProgress

LOG_SECONDS: Final = 60.0
"""Least time between two lines of a log."""

HOUR: Final = 3600.0
"""Seconds."""

REWRITE_SECONDS: Final = 0.5
"""Least time between two states of the line on a terminal."""


class LiveLine:
    """Draws the progress line; as a watcher of runs, it describes the one that reports to it."""

    def __init__(
        self,
        write: Callable[[str], None],
        columns: int | None,
        clock: Callable[[], float] = time.monotonic,
        log_seconds: float = LOG_SECONDS,
    ) -> None:
        """Draw with `write`: in place on a terminal of `columns` columns, or as a log if None.

        A log has a line each `log_seconds` at most, by a `clock` of seconds.
        """
        self._write = write
        self._width = None if columns is None else max(columns - 1, 20)
        self._seconds = log_seconds if columns is None else REWRITE_SECONDS
        self._clock = clock
        self._at = -self._seconds
        self._open = False
        self._shown = ""

    def __call__(self, progress: RunProgress) -> None:
        """Show the newest state of a run."""
        self.show(lambda: describe(progress), progress.remark)

    def show(self, text: Callable[[], str], at_once: bool = False) -> None:
        """Show what `text` returns, if anything, unless the line was rewritten just now; `at_once` shows it even so."""
        if not at_once and self._clock() - self._at < self._seconds:
            return
        text_now = text()
        if not text_now or (text_now == self._shown and self._open and self._width is not None):
            return
        self._at = self._clock()
        start = "" if self._open and self._width is None else "\r" if self._open else "\n"
        self._write(start + (f"  {text_now}\n" if self._width is None else text_now[: self._width].ljust(self._width)))
        self._open, self._shown = True, text_now

    def close(self) -> None:
        """Leave the line, so that other output starts on a fresh one."""
        if self._open and self._width is not None:
            self._write("\r" + " " * self._width + "\r")
            self._at = -self._seconds  # what is gone is drawn again as soon as there is something to tell
        self._open = False


def describe(progress: RunProgress) -> str:
    """Return the line: condition, trials, step, level, best, time left; safe to print, whatever the names contain."""
    if not progress.total_steps:
        count = f" ({progress.trials} trials)" if progress.trials else ""
        return printable(f"{progress.condition}: {progress.phase}{count}")
    left = "" if progress.seconds_left is None else f", {duration(progress.seconds_left)} left"
    best = "" if progress.best is None else f", best {progress.best:.3f}"
    level = f", level {progress.level} of {progress.levels - 1}" if progress.levels else ""
    return printable(
        f"{progress.condition}: {progress.ended}/{progress.trials} trials ended, "
        f"step {progress.steps:,}/{progress.total_steps:,}{level}{best}{left}"
    )


def describe_all(overview: Overview) -> str:
    """Return the line of a run of claims: claims, trials, time left, and what is running.

    Several batches get few words each, so that all have room.
    """
    left = "" if overview.seconds_left is None else f", about {duration(overview.seconds_left)} left"
    now = [one.progress for one in overview.running]
    parts = [describe(now[0])] if len(now) == 1 else [_briefly(one) for one in now]
    count = f"{overview.judged}/{overview.claims} claims, {overview.done:,}/{overview.trials:,} trials{left}"
    return "; ".join([count, *parts])


def _briefly(progress: RunProgress) -> str:
    if not progress.total_steps:
        return printable(f"{progress.condition}: {progress.phase}")
    done = f"{progress.ended}/{progress.trials}, step {progress.steps:,}/{progress.total_steps:,}"
    return printable(f"{progress.condition}: {done}")


def beforehand(load: Workload) -> str:
    """Return what is to be known before a run of hours on processors; empty for a shorter one."""
    costs = [work.cost for work in load.conditions.values() if work.missing and work.cost.layout.alone]
    seconds = sum(cost.work for cost in costs if cost.basis != "budget")
    if seconds < HOUR:
        return ""
    whole = all(cost.basis != "budget" for cost in costs)
    return (
        f"The missing trials take up to {seconds / HOUR:,.0f} hours of a processor's core"
        f"{'' if whole else ', and more without a timing'}. `evoclaims plan` of this tier says which, and what "
        "they took elsewhere. A run that is stopped goes on where it was."
    )


def duration(seconds: float) -> str:
    """Return a length of time as people write it, such as "40 s", "3 min 20 s", "2 h 05 min"."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
