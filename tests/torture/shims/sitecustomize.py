"""What a process under attack takes for its host's name and for the time, where the system itself cannot be changed.

TORTURE_HOST is a name; TORTURE_CLOCK is a file that holds by how many seconds the clock is wrong, at any moment;
TORTURE_LEASE is for how many seconds a notice counts.
"""

import os
import socket
import time
from typing import Any

if "TORTURE_LEASE" in os.environ:
    import filelock

    class HastyLease(filelock.SoftFileLease):
        """A lease that counts for a shorter time than it was asked to."""

        def __init__(self, path: Any, *, lease_duration: float, heartbeat_interval: float, **options: Any) -> None:
            hasty = float(os.environ["TORTURE_LEASE"])
            heartbeat_interval *= hasty / lease_duration
            super().__init__(path, lease_duration=hasty, heartbeat_interval=heartbeat_interval, **options)

    filelock.SoftFileLease = HastyLease  # type: ignore[misc]

if "TORTURE_HOST" in os.environ:
    socket.gethostname = lambda: os.environ["TORTURE_HOST"]

if "TORTURE_CLOCK" in os.environ:
    _time, _utime = time.time, os.utime

    def wrong_time() -> float:
        with open(os.environ["TORTURE_CLOCK"]) as file:
            return _time() + float(file.read() or 0)

    def wrong_utime(path: Any, times: Any = None, **options: Any) -> None:
        if times is None and "ns" not in options:
            times = (wrong_time(), wrong_time())
        _utime(path, times, **options)

    time.time, os.utime = wrong_time, wrong_utime
