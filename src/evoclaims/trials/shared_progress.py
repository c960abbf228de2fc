"""The progress of a running batch, for other processes: in a file beside its notice.

These files are hints, as notices are: one that cannot be written or read costs a line of progress, and nothing else.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import msgspec

from evoclaims.core.errors import UserError
from evoclaims.core.files import at_once, read_file
from evoclaims.trials.notice import is_announced, progress_path
from evoclaims.trials.progress import RunProgress, Watcher

WRITE_SECONDS: Final = 0.5
"""Least time between two writings, unless the phase changes."""


@dataclass(frozen=True)
class Running:
    """A batch that some process is running.

    Attributes:
        condition: id of its condition.
        since: when that process began with the condition, in seconds of the epoch by its own clock.
        progress: the newest.
    """

    condition: str
    since: float
    progress: RunProgress


@contextlib.contextmanager
def shared(store_root: Path, condition_id: str, watch: Watcher) -> Iterator[Watcher]:
    """Give a watcher that passes on to `watch`, and shares the progress until the `with` block ends."""
    path, since = progress_path(store_root, condition_id), time.time()
    written, phase = -WRITE_SECONDS, ""

    def tell(progress: RunProgress) -> None:
        nonlocal written, phase
        if progress.phase != phase or time.monotonic() - written >= WRITE_SECONDS:
            written, phase = time.monotonic(), progress.phase
            with contextlib.suppress(OSError), open(path, "wb", opener=at_once) as file:
                file.write(msgspec.json.encode(Running(condition_id, since, progress)))
        watch(progress)

    try:
        yield tell
    finally:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)


def running(store_root: Path) -> list[Running]:
    """Return what processes that share a store are running, those that began first in front."""
    found = []
    for path in (store_root / "running").glob("*.progress"):
        # It may be written just now, gone, or damaged.
        with contextlib.suppress(OSError, ValueError, RecursionError, UserError):
            one = msgspec.json.decode(read_file(path), type=Running)
            if one.condition == path.stem and is_announced(store_root, one.condition):
                found.append(one)
    return sorted(found, key=lambda one: (one.since, one.condition))
