"""Ending work: on Ctrl-C or a scheduler's signal (SIGTERM), or when it takes longer than it may.

Nothing can interrupt a compiled program or a callback that never returns. So such work runs on its own thread; when the
time is over, the thread is abandoned, and the process continues without it.
"""

from __future__ import annotations

import _thread
import contextlib
import math
import os
import queue
import signal
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from concurrent.futures import Future, wait
from contextlib import contextmanager
from types import FrameType
from typing import Any, Final, TypeVar

from evoclaims.core.waiting import working_time

_asked = threading.Event()
_postponed = threading.Event()
_deaf_since: float | None = None

AGAIN_SECONDS: Final = 0.02
"""How soon a signal comes again that came where nothing can be raised."""
DEAF_SECONDS: Final = 5.0
"""How long it may come again: a user's module may take longer to import, and is interrupted then."""


@contextmanager
def interrupted_by(number: signal.Signals) -> Iterator[None]:
    """Let a signal interrupt a `with` block: Ctrl-C at once; with others, a running batch writes a checkpoint first.

    An interrupt that comes while a module is imported, or while jax collects garbage, would be lost or crash the
    process; it is raised after that. A signal that this process was started to ignore stays ignored, and no thread but
    the main one may listen to one.
    """
    global _deaf_since
    before = signal.getsignal(number)
    if before in (signal.SIG_IGN, None) or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(number, _interrupt)
    try:
        yield
    finally:
        signal.signal(number, before)
        _asked.clear()
        _deaf_since = None


@contextmanager
def only_told(number: signal.Signals, tell: Callable[[], object]) -> Iterator[None]:
    """Let a signal interrupt nothing in a `with` block, where what was begun ends soon; `tell` is called instead."""
    before = signal.getsignal(number)
    if before in (signal.SIG_IGN, None) or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(number, lambda *_: tell())
    try:
        yield
    finally:
        signal.signal(number, before)


@contextmanager
def postponed() -> Iterator[threading.Event]:
    """Hold such a signal back for a `with` block, which is given the event that says that one has come.

    Raises:
        KeyboardInterrupt: at the end of the block, when one has come.
    """
    _postponed.set()
    try:
        yield _asked
    finally:
        _postponed.clear()
    if _asked.is_set():
        raise KeyboardInterrupt


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Ask the running batch to end; interrupt at once on Ctrl-C, without a batch, or at the second request."""
    global _deaf_since
    if _is_deaf(frame):
        _deaf_since = _deaf_since or time.monotonic()
        if time.monotonic() - _deaf_since < DEAF_SECONDS:
            _thread.start_new_thread(_send_again, (number,))  # unlike `threading.Timer` it takes no lock
            return
    _deaf_since = None
    if number == signal.SIGINT or not _postponed.is_set() or _asked.is_set():
        raise KeyboardInterrupt
    _asked.set()


def _is_deaf(frame: FrameType | None) -> bool:
    """Whether what is raised in a frame is ignored by a caller, or by C++ that it ends."""
    while frame is not None:
        code = frame.f_code
        if code.co_name == "_xla_gc_callback" or code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _send_again(number: int) -> None:
    time.sleep(AGAIN_SECONDS)
    os.kill(os.getpid(), number)


T = TypeVar("T")

LOOK_SECONDS: Final = 1.0
"""Time between two looks at the clock; more than twice this is not counted: the process was stopped. Nor is it counted
when the process waits for another one that compiles the same kernel."""

WAITS: Final = "\nevoclaims: interrupted; waiting for what is being computed. Ctrl-C again ends at once."
"""Printed after a Ctrl-C where the work takes longer than a look."""

_working: weakref.WeakSet[Future[Any]] = weakref.WeakSet()
"""What all threads make; known before they start, since several interrupts may come at any time.

Threads are not asked: before Python 3.13 a thread whose `join` was interrupted says that it has ended, and it has not.
"""


def next_of(events: queue.SimpleQueue[T]) -> T:
    """Wait for the next item of a queue, and hear a signal meanwhile.

    One that comes in the microseconds before a wait for a lock, or that the system gives to another thread, does not
    end that wait: it must end by itself now and then.
    """
    while True:
        with contextlib.suppress(queue.Empty):
            return events.get(timeout=LOOK_SECONDS)


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
            wait([made], min(LOOK_SECONDS, self.left))
            if not made.done():
                with contextlib.suppress(Exception):  # a full disk, a reader that is gone
                    print(WAITS, file=sys.stderr, flush=True)
            self._wait(made)
            raise
        if not made.done():
            raise OutOfTimeError
        return made.result()

    def _wait(self, made: Future[Any]) -> None:
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
    try:
        made.set_result(work())
    except BaseException as error:
        made.set_exception(error)
