"""A time limit for work that may never return, and the exit of a process that has abandoned such work.

Nothing can interrupt a compiled program or a callback that never returns. So the work runs on its own thread; when the
time is over, the thread is abandoned, and the process continues without it.
"""

from __future__ import annotations

import contextlib
import math
import os
import sys
import threading
import weakref
from collections.abc import Callable
from concurrent.futures import Future, wait
from typing import Any, Final, TypeVar

from evoclaims.core.waiting import working_time

T = TypeVar("T")

LOOK_SECONDS: Final = 1.0
"""Time between two looks at the clock; more than twice this is not counted: the process was stopped. Nor is it counted
when the process waits for another one that compiles the same kernel."""

_working: weakref.WeakSet[Future[Any]] = weakref.WeakSet()
"""What all threads make; known before they start, since several interrupts may come at any time.

Threads are not asked: before Python 3.13 a thread whose `join` was interrupted says that it has ended, and it has not.
"""


class OutOfTimeError(Exception):
    """The allowed time is over, and the work has not returned."""


class Allowance:
    """A number of seconds for work; infinity means no limit.

    Attributes:
        left: seconds not yet spent.
    """

    def __init__(self, seconds: float) -> None:
        """Start with all `seconds`."""
        self.left = seconds

    def spend(self, work: Callable[[], T]) -> T:
        """Return what `work` returns, or raise what it raises; with a limit it runs on its own thread.

        Settings of jax for one thread only (its context managers) have no effect there.

        Raises:
            OutOfTimeError: when it does not return in time. Its thread is abandoned.
        """
        if math.isinf(self.left):
            return work()
        if self.left <= 0:
            raise OutOfTimeError
        made: Future[T] = Future()
        thread = threading.Thread(target=_do, args=(work, made), name="evoclaims work", daemon=True)
        _working.add(made)
        thread.start()
        try:
            self._wait(made)
        except BaseException:  # on an interrupt, wait for the work, as on this thread; a second one ends the wait
            self._wait(made)
            raise
        if not made.done():
            raise OutOfTimeError
        return made.result()

    def _wait(self, made: Future[Any]) -> None:
        """Wait until the work is done or the time is over."""
        while not made.done() and self.left > 0:
            began = working_time()
            wait([made], min(LOOK_SECONDS, self.left))
            self.left -= min(working_time() - began, 2 * LOOK_SECONDS)


def end_without(status: int) -> None:
    """Exit the process at once if it has abandoned work that still runs, else do nothing.

    The interpreter's normal exit would wait for such a thread, or crash it (a segmentation fault).
    """
    if not all(made.done() for made in _working):
        for stream in filter(None, (sys.stdout, sys.stderr)):
            with contextlib.suppress(OSError):  # a full disk
                stream.flush()
        os._exit(status)


def _do(work: Callable[[], Any], made: Future[Any]) -> None:
    """Do the work and keep its result or error."""
    try:
        made.set_result(work())
    except BaseException as error:
        made.set_exception(error)
