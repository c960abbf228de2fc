"""Ending on a signal (SIGTERM) with a checkpoint: schedulers and containers send one before they kill a process."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_asked = threading.Event()
_postponed = threading.Event()


@contextmanager
def interrupted_by(number: signal.Signals) -> Iterator[None]:
    """Let a signal interrupt a `with` block as Ctrl-C does, except that a running batch writes a checkpoint first.

    A signal that this process was started to ignore stays ignored, and no thread but the main one may listen to one.
    """
    before = signal.getsignal(number)
    if before is signal.SIG_IGN or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(number, _interrupt)
    try:
        yield
    finally:
        signal.signal(number, before)
        _asked.clear()


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
    """Ask the running batch to end; interrupt at once where there is none, or where it was asked before."""
    if not _postponed.is_set() or _asked.is_set():
        raise KeyboardInterrupt
    _asked.set()
