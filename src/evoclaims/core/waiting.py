"""A clock that stands still while this process waits for another one: waiting is nobody's time."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

_lock = threading.Lock()  # of what follows
_waits = 0
_since = 0.0
_waited = 0.0


@contextmanager
def waiting() -> Iterator[None]:
    """Stop the clock during a `with` block, in which a thread waits for another process."""
    global _waits, _since, _waited
    with _lock:
        _since = _since if _waits else time.monotonic()
        _waits += 1
    try:
        yield
    finally:
        with _lock:
            _waits -= 1
            _waited += 0.0 if _waits else time.monotonic() - _since


def working_time() -> float:
    """Return seconds of a clock that never runs back, and stands still while any thread waits."""
    with _lock:
        return (_since if _waits else time.monotonic()) - _waited
