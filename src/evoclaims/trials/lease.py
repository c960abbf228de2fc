"""Leases on running conditions, and their progress, so that processes that share a store do not repeat trials.

A lease is one of filelock on a file in `running/`, which a thread refreshes while the condition runs. Leases are
hints, not locks: a missed or lost lease costs repeated work, never a wrong record, so failures to write one are
ignored. A lost file of progress costs a line of progress.
"""

from __future__ import annotations

import contextlib
import os
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import filelock
import msgspec

from evoclaims.core.errors import UserError
from evoclaims.core.files import at_once, read_file
from evoclaims.trials.progress import RunProgress, Watcher
from evoclaims.trials.result_codec import checked_id

FRESH_SECONDS: Final = 60.0
"""A lease is valid for this long after its last refresh, by the clock of the waiting process: its own process may be
on another machine, or stopped (SIGSTOP, Ctrl-Z). If that process was on this machine and has ended, it is invalid."""

REFRESH_SECONDS: Final = 15.0
"""Time between two refreshes: on a slow network folder, a few may be late before the lease looks stale."""

POLL_SECONDS: Final = 0.2
"""Time between two looks at another process's lease."""

_CONTAINER: Final = "?pidns-"
"""What filelock adds to the host name in its own PID namespace, as in a container; a number follows."""

_INITIAL: Final = 0xEFFFFFFC
"""The number of the host's own PID namespace, fixed by Linux; filelock adds nothing there."""


def lease_path(store_root: Path, condition_id: str) -> Path:
    """Return the path of a condition's lease; raise a `UserError` for a text that is not an id."""
    return store_root / "running" / f"{checked_id(condition_id, 'condition')}.lock"


def progress_path(store_root: Path, condition_id: str) -> Path:
    """Return the path of the progress beside a condition's lease (see `running`)."""
    return lease_path(store_root, condition_id).with_suffix(".progress")


def is_announced(store_root: Path, condition_id: str) -> bool:
    """Whether a process says that it runs a condition, and has not ended as far as is known here."""
    path = lease_path(store_root, condition_id)
    return path.exists() and not _has_ended(_lease(path).owner)


@contextlib.contextmanager
def announced(
    store_root: Path,
    condition_id: str,
    tell: Callable[[str], None] = lambda text: None,
    sleep: Callable[[float], None] = time.sleep,
) -> Iterator[None]:
    """Wait until no other process runs a condition; announce, during a `with` block, that this process does.

    The other process may have stored the trials: check the store inside the block.

    Args:
        store_root: the store's folder.
        condition_id: the condition to run.
        tell: receives a line of progress each time it looks at another process's lease.
        sleep: how to wait.
    """
    path = lease_path(store_root, condition_id)
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
    lease = _lease(path)
    seen, since = _refreshed(path), time.monotonic()
    while not _is_ours(lease):
        owner, refreshed = lease.owner, _refreshed(path)
        if not refreshed:
            continue  # it is gone by now
        if refreshed != seen:
            seen, since = refreshed, time.monotonic()
        if _has_ended(owner) or time.monotonic() - since > FRESH_SECONDS:
            lease.force_break()  # filelock keeps leases of zombies, and stale leases on network folders
            continue
        who = f"process {owner.pid} on {owner.hostname.partition(_CONTAINER)[0]}" if owner else "another process"
        tell(f"waiting for {who}, which runs the same condition")
        sleep(POLL_SECONDS)
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            lease.release()
        sweep(store_root)


def sweep(store_root: Path) -> None:
    """Remove the leases and progress files of this machine's ended processes: nobody else may ever look at them."""
    for path in sorted((store_root / "running").glob("*.lock")):
        lease = _lease(path)
        if _has_ended(lease.owner):
            lease.force_break()
    for path in sorted((store_root / "running").glob("*.progress")):
        with contextlib.suppress(OSError):
            if not path.with_suffix(".lock").exists():
                path.unlink(missing_ok=True)


def _lease(path: Path) -> filelock.SoftFileLease:
    return filelock.SoftFileLease(path, lease_duration=FRESH_SECONDS, heartbeat_interval=REFRESH_SECONDS)


def _is_ours(lease: filelock.SoftFileLease) -> bool:
    """Take a lease unless another process holds it; if no process can take it, do not wait for it."""
    try:
        lease.acquire(blocking=False)
    except (filelock.Timeout, filelock.LeaseSettingsMismatch):
        return lease.is_lock_held_by_us
    except OSError:
        pass
    return True


def _refreshed(path: Path) -> int:
    """Return when a lease was last refreshed, by the clock of its writer; 0 without one."""
    try:
        return path.lstat().st_mtime_ns
    except OSError:
        return 0


def _has_ended(owner: filelock.OwnerRecord | None) -> bool:
    """Whether a process of this machine has ended, according to Linux; zombies count as ended."""
    try:
        namespace = os.stat("/proc/self/ns/pid").st_ino
    except OSError:
        return False
    # In another container PIDs mean other processes, also where its host name is the same: only the exact owner counts.
    here = socket.gethostname() + ("" if namespace == _INITIAL else f"{_CONTAINER}{namespace:x}")
    if owner is None or owner.hostname != here:
        return False
    try:
        state = Path(f"/proc/{owner.pid}/stat").read_text(errors="replace").rpartition(")")[2].split()[0]
    except OSError:
        return not _exists(owner.pid)
    return state in ("Z", "X")


def _exists(pid: int) -> bool:
    """Whether a process exists, even if /proc hides other users' processes (hidepid)."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        pass
    return True


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
