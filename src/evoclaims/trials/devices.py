"""The device of every trial: its choice, jax's settings, and the cache of compiled programs.

jax writes an entry of its cache in place and never again: one that a full disk or a kill has torn would be compiled at
every run, and one that is a pipe would be waited for.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import gc
import importlib
import os
import re
import stat
import sys
import time
import zlib
from collections.abc import Iterator
from contextlib import AbstractContextManager
from functools import cache
from pathlib import Path
from typing import Any, Final

import jax
from threadpoolctl import threadpool_limits

from evoclaims.core.errors import UserError, require_known
from evoclaims.core.files import doubt, make_private, read_file, say_refused
from evoclaims.core.forked import refuse_forked
from evoclaims.trials.jax_options import refuse_changed

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


DEVICE_NAMES: Final = ("auto", "cpu", "gpu")
MATMUL_PRECISION: Final = "highest"
"""Full float32: with the tensor cores' default of 10-bit mantissas, CMA-ES's covariances would be noise."""
_COLLECTIONS: Final = (100_000, 20, 20)
"""Thresholds of Python's garbage collector: tracing makes a hundred thousand objects, nearly all of which live on."""


_sweep_once: Final = functools.cache(sweep)


def configure() -> None:
    """Prepare jax before its first use: set and sweep a persistent compilation cache, and collect garbage less often.

    A cache that the user has set (JAX_COMPILATION_CACHE_DIR) stays.

    Raises:
        UserError: when JAX_PLATFORMS names missing hardware.
    """
    share_heaps()
    gc.set_threshold(*_COLLECTIONS)  # looking through all of them took a sixth of the time of tracing
    config: Any = jax.config
    if config.jax_compilation_cache_dir is None:
        if folder := _cache():
            config.update("jax_compilation_cache_dir", str(folder))
        config.update("jax_persistent_cache_min_compile_time_secs", 0.2)
        # jax would otherwise evict nothing and warn about nothing; a broken cache must not break a run.
        config.update("jax_raise_persistent_cache_errors", False)
        if folder:
            _sweep_once(folder)
    else:
        _sweep_once(Path(config.jax_compilation_cache_dir), most=None)
    choose("auto")  # fail here with a clear error, not with a traceback in a later import


def _cache() -> Path | None:
    """Return the folder of compiled programs; None, with a warning, where another user could put programs into it."""
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    # A relative path is invalid by the XDG specification: it would let any folder bring its own programs.
    folder = (named if named.is_absolute() else Path.home() / ".cache") / "evoclaims" / "xla"
    try:
        make_private(folder)
        why = doubt(folder.parent) or doubt(folder)
    except OSError:  # a read-only disk: jax goes on without
        return folder
    if why:
        say_refused(folder, why)
    return None if why else folder


def keep_off_gpus() -> None:
    """Let jax in this process see no GPU, before its first use: a GPU's memory is for those that run trials on it."""
    jax.config.update("jax_platforms", "cpu")


def usable_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def single_threaded_linear_algebra() -> AbstractContextManager[object]:
    """Keep LAPACK, which jax calls for eigenvalues on a CPU, on the thread of the calling trial.

    Trials already fill the cores. With its own threads, OpenBLAS waits in busy loops for cores that other trials use
    (measured: 50 times slower), and its bits would depend on the number of cores.
    """
    import scipy.linalg  # noqa: F401  (loads the library that is limited)

    limited: AbstractContextManager[object] = threadpool_limits(limits=1, user_api="blas")
    return limited


def choose(name: str) -> list[jax.Device]:
    """Return the devices called `name`: "auto" takes GPUs if there are any.

    Raises:
        UserError: when a GPU is requested, here or by JAX_PLATFORMS, and jax sees none, in a forked process where
            jax cannot compute, and where an option of jax would change trials (see `jax_options`).
    """
    require_known("device", name, DEVICE_NAMES)
    refuse_forked()
    refuse_changed()
    try:
        return list(jax.devices(None if name == "auto" else name))
    except (RuntimeError, AssertionError) as error:  # jax asserts that a platform in JAX_PLATFORMS has a plugin
        platforms = os.environ.get("JAX_PLATFORMS")
        wish = f"the device {name!r}" + (f" with JAX_PLATFORMS={platforms}" if platforms else "")
        raise UserError(
            f"jax {jax.__version__} finds no hardware for {wish}. Install jax for CUDA "
            '(pip install "jax[cuda13]", Python 3.12 or newer) on a machine with a GPU, or ask for the device "cpu".'
        ) from error


_M_ARENA_MAX: Final = -8
"""The number by which `mallopt` knows the most heaps of a process."""

_ARENAS: Final = 2


def share_heaps() -> None:
    """Let all threads allocate from two heaps, before there are many threads.

    Each of XLA's threads would have its own, and what one has freed serves no other: compiling the ant's programs took
    859 MB so and takes 738 MB now, in the same time. Small blocks do not wait for a heap: each thread caches them.
    """
    if (libc := _libc()) is not None:
        libc.mallopt(_M_ARENA_MAX, _ARENAS)


def give_back() -> None:
    """Return freed memory to the system, where glibc keeps it: what compiling has freed is never used again as a whole.

    It takes milliseconds. After a smoke tier it was 650 of 1,500 MB.
    """
    if (libc := _libc()) is not None:
        libc.malloc_trim(0)


@cache
def _libc() -> Any:
    """Return the C library if it is glibc; None on systems with another one."""
    try:
        libc = ctypes.CDLL(None) if sys.platform == "linux" else None
        return libc if hasattr(libc, "malloc_trim") and hasattr(libc, "mallopt") else None
    except OSError:
        return None
