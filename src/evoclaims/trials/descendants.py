"""Ending what a trial's process has started, also in sessions of their own, by a mark in their environment."""

from __future__ import annotations

import contextlib
import os
import signal
from pathlib import Path
from typing import Final

MARK: Final = "EVOCLAIMS_TRIAL_PROCESS"
"""Variable that a trial's process hands down; its value is of one trial."""


def end_marked(value: str) -> None:
    """Kill all processes with this value of the mark but this one; on Linux alone, whose /proc shows environments."""
    wanted = f"{MARK}={value}".encode()
    for _ in range(3):  # one may start another meanwhile
        found = [pid for pid in _processes() if pid != os.getpid() and wanted in _environment(pid)]
        for pid in found:
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        if not found:
            return


def _processes() -> list[int]:
    """Return the numbers of all processes."""
    try:
        return [int(name) for name in os.listdir("/proc") if name.isdecimal()]
    except OSError:
        return []


def _environment(pid: int) -> list[bytes]:
    """Return the variables that a process was started with; none where it is gone, or another user's."""
    try:
        return Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
    except OSError:
        return []
