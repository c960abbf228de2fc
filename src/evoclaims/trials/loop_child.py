"""The process of one trial of a training loop, seen from the one that has started it."""

from __future__ import annotations

import contextlib
import os
import secrets
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from typing import Final

import msgspec

from evoclaims.trials.descendants import MARK, end_marked
from evoclaims.trials.loop_messages import Answer, LoopReport, LoopRequest, Waiting, decode, encode, last_lines

_READ: Final = 4000
_KEPT: Final = 2**16
"""Bytes at the end of what a process prints that are kept."""
_PATIENCE: Final = 5.0
"""Seconds to wait for the end of that, which something that it has started may hold open."""


class Child:
    """A process that runs one trial."""

    def __init__(self, request: LoopRequest, environment: Mapping[str, str]) -> None:
        """Start it, as the leader of a group of its own, with these environment variables besides this process's."""
        self._mark = secrets.token_hex(16)
        self._process = subprocess.Popen(
            # Modules are where this process has them, and what was printed is there when the process is killed.
            [sys.executable, "-P", "-u", "-m", "evoclaims.trials.loop_process"],
            stdin=subprocess.PIPE,  # stays open as long as this process lives
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={**os.environ, **environment, MARK: self._mark},
            start_new_session=True,
        )
        self._printed = bytearray()
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # one that has died at once is found when it does not answer
            self._process.stdin.write(encode(request))
            self._process.stdin.flush()

    def answers(self) -> Iterator[Answer]:
        """Iterate over its answers, up to the last one; what it has started may keep the pipe open after that."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            try:
                answer = decode(line)
            except (msgspec.MsgspecError, ValueError):  # it died in the middle of a line
                return
            yield answer
            if not isinstance(answer, LoopReport | Waiting):
                return

    def stop(self) -> None:
        """End it, whatever it does, and what it has started; its number is not given away before it is closed."""
        with contextlib.suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)
        end_marked(self._mark)

    def _listen(self) -> None:
        """Keep the end of what it prints: a progress bar of a day would fill the disk."""
        assert self._process.stderr is not None
        with contextlib.suppress(OSError, ValueError):  # closed meanwhile
            while part := os.read(self._process.stderr.fileno(), _KEPT):
                self._printed += part
                del self._printed[:-_KEPT]

    def close(self) -> str:
        """End it, and return why it ended without an answer: its last lines, and its signal or status."""
        self.stop()
        status = self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()
        self._listener.join(_PATIENCE)
        last = last_lines(bytes(self._printed[-_READ:]).decode(errors="replace"))
        if not self._listener.is_alive() and self._process.stderr is not None:
            self._process.stderr.close()
        how = signal.Signals(-status).name if -status in set(signal.Signals) else f"status {status}"
        return f"{last}\nits process ended with {how}".lstrip()
