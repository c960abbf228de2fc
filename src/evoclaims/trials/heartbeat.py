"""Doing something again and again beside a long computation."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def beating(beat: Callable[[], None], seconds: float) -> Iterator[None]:
    """Call `beat` every `seconds` on a thread of its own for as long as a `with` block lasts.

    The thread runs while XLA compiles or computes, which leaves the interpreter free, and ends with the process. `beat`
    must not raise.
    """
    stop = threading.Event()

    def repeat() -> None:
        while not stop.wait(seconds):
            beat()

    thread = threading.Thread(target=repeat, name="evoclaims heartbeat", daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
