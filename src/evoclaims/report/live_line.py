"""One line that shows how a run is getting on: rewritten in place on a terminal, now and then in a log."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final, Protocol

from evoclaims.core.printable import printable
from evoclaims.trials.progress import RunProgress

LOG_SECONDS: Final = 10.0
"""Least time between two lines of a log about the same condition."""


class Terminal(Protocol):
    """Where the line goes; pytest's own `TerminalWriter` is one."""

    fullwidth: int
    hasmarkup: bool

    def write(self, msg: str, *, flush: bool = False) -> None:
        """Write text as it is."""


class LiveLine:
    """A watcher of runs that draws the progress line."""

    def __init__(self, terminal: Terminal, clock: Callable[[], float] = time.monotonic) -> None:
        """Draw on `terminal`: in place when it has markup (a terminal), else as a log."""
        self._terminal = terminal
        self._clock = clock
        self._shown = ("", "")
        self._at = -LOG_SECONDS
        self._open = False

    def __call__(self, progress: RunProgress) -> None:
        """Show the newest state."""
        if self._terminal.hasmarkup:
            width = max(self._terminal.fullwidth - 1, 20)
            start = "\r" if self._open else "\n"
            self._terminal.write(start + describe(progress)[:width].ljust(width), flush=True)
            self._open = True
            return
        step = (progress.condition, progress.phase)
        finished = progress.trials > 0 and progress.ended == progress.trials
        if step != self._shown or finished or self._clock() - self._at >= LOG_SECONDS:
            self._terminal.write(("" if self._open else "\n") + f"  {describe(progress)}\n", flush=True)
            self._shown, self._at, self._open = step, self._clock(), True

    def close(self) -> None:
        """Leave the line, so that other output starts on a fresh one."""
        if self._open:
            width = max(self._terminal.fullwidth - 1, 20)
            if self._terminal.hasmarkup:
                self._terminal.write("\r" + " " * width + "\r", flush=True)
            self._open = False


def describe(progress: RunProgress) -> str:
    """Return the line: condition, trials, step, level, best, time left; safe to print, whoever the words are from."""
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
