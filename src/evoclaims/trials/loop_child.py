"""The process of one trial of a training loop, seen from the one that has started it."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from typing import Final

import msgspec

from evoclaims.trials.loop_messages import Answer, LoopReport, LoopRequest, decode, encode, last_lines

_READ: Final = 4000


class Child:
    """A process that runs one trial."""

    def __init__(self, request: LoopRequest, environment: Mapping[str, str]) -> None:
        """Start it, as the leader of a group of its own, with these environment variables besides this process's."""
        self._output = tempfile.TemporaryFile()  # noqa: SIM115  (closed by `close`)
        self._process = subprocess.Popen(
            # Modules are where this process has them, and what was printed is there when the process is killed.
            [sys.executable, "-P", "-u", "-m", "evoclaims.trials.loop_process"],
            stdin=subprocess.PIPE,  # stays open as long as this process lives
            stdout=subprocess.PIPE,
            stderr=self._output,
            env={**os.environ, **environment},
            start_new_session=True,
        )
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
            if not isinstance(answer, LoopReport):
                return

    def stop(self) -> None:
        """End it, whatever it does, and what it has started; its number is not given away before it is closed."""
        with contextlib.suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)

    def close(self) -> str:
        """End it, and return why it ended without an answer: its last lines, and its signal or status."""
        self.stop()
        status = self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()
        with self._output as output:
            output.seek(max(output.seek(0, os.SEEK_END) - _READ, 0))
            last = last_lines(output.read().decode(errors="replace"))
        how = signal.Signals(-status).name if -status in set(signal.Signals) else f"status {status}"
        return f"{last}\nits process ended with {how}".lstrip()
