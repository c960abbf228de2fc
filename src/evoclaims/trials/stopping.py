"""Ending on Ctrl-C or a signal that schedulers send before they kill a process (SIGTERM), wherever the process is."""

from __future__ import annotations

import _thread
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

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
    """Send this process a signal, a little later."""
    time.sleep(AGAIN_SECONDS)
    os.kill(os.getpid(), number)
