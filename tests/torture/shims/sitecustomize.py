"""What a process under attack takes for its host's name and for the time, where the system itself cannot be changed.

TORTURE_HOST is a name; TORTURE_CLOCK is a file that holds by how many seconds the clock is wrong, at any moment.
"""

import os
import socket
import time
from typing import Any

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
