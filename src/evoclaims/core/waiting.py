"""A clock that stands still while this process waits for another one: waiting is nobody's time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_lock = threading.Lock()  # of what follows
_waits = 0
_since = 0.0
_waited = 0.0
_listener: Callable[[bool], object] | None = None


def report_to(listener: Callable[[bool], object]) -> None:
    """Call a function whenever the clock stops (True) or goes on (False): another process counts this one's time."""
    global _listener
    _listener = listener


@contextmanager
def waiting() -> Iterator[None]:
    """Stop the clock during a `with` block, in which a thread waits for another process."""
    global _waits, _since, _waited
    with _lock:
        if not _waits:
            _since = time.monotonic()
            if _listener is not None:
                _listener(True)
        _waits += 1
    try:
        yield
    finally:
        with _lock:
            _waits -= 1
            if not _waits:
                _waited += time.monotonic() - _since
                if _listener is not None:
                    _listener(False)


def working_time() -> float:
    """Return seconds of a clock that never runs back, and stands still while any thread waits."""
    with _lock:
        return (_since if _waits else time.monotonic()) - _waited
