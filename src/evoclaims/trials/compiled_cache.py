"""The cache of compiled programs, swept when a process starts: damaged entries go, and the oldest beyond a bound.

jax writes an entry in place and never again: one that a full disk or a kill has torn would be compiled at every run,
and one that is a pipe would be waited for.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import re
import stat
import time
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from evoclaims.core.files import read_file

MOST_BYTES: Final = 4 * 2**30
"""Of the entries in the default cache, and of kernels in any."""

SETTLED_SECONDS: Final = 86_400.0
"""Locks and half-written files of kernels that are older belong to nobody."""

_ENTRY: Final = re.compile(r".+-[0-9a-f]{64}-cache")
"""Names of jax's entries, so that nothing else is touched in a folder that a user has named."""

_SWEPT: Final = ".swept-by-evoclaims"
_ZSTD: Final = b"\x28\xb5\x2f\xfd"


def sweep(folder: Path, most: int | None = MOST_BYTES) -> None:
    """Remove entries that are damaged or no files, and the oldest ones beyond `most` bytes; None for no bound.

    Only entries that are newer than the last sweep are read. What cannot be removed stays.
    """
    stamp, began = folder / _SWEPT, time.time()
    try:
        last = stamp.stat().st_mtime
    except OSError:
        last = 0.0
    for entry in _entries(folder):
        with contextlib.suppress(OSError):
            status = entry.lstat()
            if not stat.S_ISREG(status.st_mode):
                entry.rmdir() if stat.S_ISDIR(status.st_mode) else entry.unlink()
            elif status.st_mtime >= last and not _is_whole(entry):
                entry.unlink()
    with contextlib.suppress(OSError):
        stamp.touch()
        os.utime(stamp, (began - 1, began - 1))  # clocks of file systems are coarse
    kernels = folder / "kernels"
    for path in [*kernels.glob("*.lock"), *kernels.glob(".*.tmp")]:
        with contextlib.suppress(OSError):
            if began - path.lstat().st_mtime > SETTLED_SECONDS:
                path.unlink()
    _bound([*kernels.glob("*.o")], MOST_BYTES)
    if most is not None:
        _bound([*_entries(folder)], most)


def _entries(folder: Path) -> Iterator[Path]:
    """Yield jax's entries."""
    with contextlib.suppress(OSError):
        yield from (folder / name for name in os.listdir(folder) if _ENTRY.fullmatch(name))


def _is_whole(entry: Path) -> bool:
    """Whether an entry decompresses, as far as it can be known here."""
    data = read_file(entry)
    try:
        if data.startswith(_ZSTD):  # jax's choice where the package is installed
            zstandard = importlib.import_module("zstandard")
            zstandard.ZstdDecompressor().decompress(data)
        else:
            zlib.decompress(data)
    except ImportError:
        return True
    except Exception:  # as each library refuses
        return False
    return True


def _bound(paths: list[Path], most: int) -> None:
    """Remove the files that were used longest ago until the others have at most so many bytes."""
    found = []
    for path in paths:
        with contextlib.suppress(OSError):
            status = path.lstat()
            found.append((max(status.st_atime, status.st_mtime), status.st_size, path))
    left = most
    for _, size, path in sorted(found, reverse=True):
        left -= size
        if left < 0:
            with contextlib.suppress(OSError):
                path.unlink()
