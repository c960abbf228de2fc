"""Temporary folders that later processes remove where this one is killed."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import time
from pathlib import Path
from typing import Final

from filelock import FileLock

PREFIX: Final = "evoclaims-"
ALIVE: Final = ".alive"
"""A file that a folder's process holds a lock on as long as it lives."""

SETTLED_SECONDS: Final = 60.0
"""A younger folder may not be locked yet."""

_held: list[FileLock] = []
"""Locks live as long as this process."""


def temporary_folder(prefix: str = PREFIX) -> Path:
    """Make a folder that is this process's to remove, after removing those of processes that have been killed."""
    for left in Path(tempfile.gettempdir()).glob(f"{PREFIX}*/{ALIVE}"):
        with contextlib.suppress(OSError):
            _remove_unless_held(left)
    folder = Path(tempfile.mkdtemp(prefix=prefix))
    lock = FileLock(folder / ALIVE)
    with contextlib.suppress(OSError):  # a file system without locks: the folder stays if this process is killed
        lock.acquire(timeout=0)
        _held.append(lock)
    return folder


def _remove_unless_held(path: Path) -> None:
    """Remove the folder of a lock that nobody holds; raise an `OSError` where it is held, or another user's."""
    status = path.lstat()
    if status.st_uid != os.getuid():
        return
    if time.time() - status.st_mtime > SETTLED_SECONDS:
        with FileLock(path, timeout=0):
            shutil.rmtree(path.parent, ignore_errors=True)
