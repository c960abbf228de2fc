"""Time that may be spent on work which may never return, and the end of a process that has left such work behind.

Nothing interrupts a compiled program that loops for ever, or a callback that waits for ever. So the work has a thread
of its own; when the time is over, the thread is left behind, and the process goes on without it.
"""

from __future__ import annotations

import math
import os
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Final, TypeVar

T = TypeVar("T")

LOOK_SECONDS: Final = 1.0
"""Time between two looks at the clock; what passes beyond twice this did not pass for the work: a stopped process."""

_left_behind: list[threading.Thread] = []


class OutOfTimeError(Exception):
    """The time allowed is over, and the work has not returned."""


class Allowance:
    """So many seconds of work, infinitely many for no limit.

    Attributes:
        left: seconds that have not been spent.
    """

    def __init__(self, seconds: float) -> None:
        """Start with all of them."""
        self.left = seconds

    def spend(self, work: Callable[[], T]) -> T:
        """Return what `work` returns, or raise what it raises; with a limit it runs on a thread of its own.

        Settings of jax that hold for one thread only (its context managers) do not hold there.

        Raises:
            OutOfTimeError: when it does not return before the time is over. Its thread is left behind.
        """
        if math.isinf(self.left):
            return work()
        if self.left <= 0:
            raise OutOfTimeError
        made: Future[T] = Future()
        thread = threading.Thread(target=_do, args=(work, made), name="evoclaims work", daemon=True)
        thread.start()
        try:
            self._wait(thread)
        except BaseException:  # an interrupt: the work ends first, as it would on this thread, unless there is another
            self._wait(thread)
            raise
        finally:
            if thread.is_alive():
                _left_behind.append(thread)
        if not made.done():
            raise OutOfTimeError
        return made.result()

    def _wait(self, thread: threading.Thread) -> None:
        """Wait until the thread has ended or the time is over."""
        while thread.is_alive() and self.left > 0:
            began = time.monotonic()
            thread.join(min(LOOK_SECONDS, self.left))
            self.left -= min(time.monotonic() - began, 2 * LOOK_SECONDS)


def end_without(status: int) -> None:
    """End the process at once if it has left work behind, else do nothing.

    The interpreter's own way out would wait for such a thread, or end its Python from under it (a segmentation fault).
    """
    if any(thread.is_alive() for thread in _left_behind):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def _do(work: Callable[[], Any], made: Future[Any]) -> None:
    """Do the work and keep what becomes of it."""
    try:
        made.set_result(work())
    except BaseException as error:
        made.set_exception(error)
