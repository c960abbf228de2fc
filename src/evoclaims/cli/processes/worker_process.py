"""A worker process, seen from the command that has started it."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from typing import IO, Any

import msgspec

from evoclaims.cli.processes.job import Job
from evoclaims.cli.processes.worker import Ended, Reply, Told, WorkOrder


class Process:
    """A process that runs one condition after the other, as it is asked to."""

    def __init__(self, order: WorkOrder, environment: Mapping[str, str]) -> None:
        """Start it, with these environment variables besides the command's own."""
        # A process inherits what is blocked here: Ctrl-C cannot end it before `worker.main` ignores it.
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "evoclaims.cli.processes.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env={**os.environ, **environment},
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        process: Any = self._process
        pipes: tuple[IO[bytes], ...] = process.stdin, process.stdout, process.stderr
        self._input, self._output, self._error_output = pipes
        self._errors = threading.Thread(target=self._pass_errors_on, daemon=True)
        self._errors.start()
        self._ask(order)

    def is_ready(self) -> bool:
        """Wait until it can run conditions; False where it has died before."""
        return isinstance(self._reply(), Told)

    def run(self, job: Job, tell: Callable[[str], None]) -> Ended | None:
        """Run a condition to its end; None where the process died of it."""
        self._ask(job)
        while isinstance(reply := self._reply(), Told):
            tell(reply.text)
        return reply

    def why(self) -> str:
        """Return how it has ended, such as "status 7"."""
        status = self._process.wait()
        if status == -signal.SIGKILL:
            return "SIGKILL: the system sends that where memory runs out"
        return signal.Signals(-status).name if -status in set(signal.Signals) else f"status {status}"

    def close(self) -> None:
        """Give it nothing more to do, and wait for its end."""
        with contextlib.suppress(OSError):  # it is dead already
            self._input.close()
        self._process.wait()
        self._errors.join()
        self._output.close()
        self._error_output.close()

    def stop(self) -> None:
        """End it, whatever it does; it is still to be closed."""
        self._process.terminate()

    def _ask(self, what: WorkOrder | Job) -> None:
        """Write a line to its standard input; a dead process is found when it does not reply."""
        with contextlib.suppress(OSError):
            self._input.write(msgspec.json.encode(what) + b"\n")
            self._input.flush()

    def _reply(self) -> Reply | None:
        """Wait for its next reply; None where it has died."""
        line = self._output.readline()
        try:
            return msgspec.json.decode(line, type=Reply) if line else None
        except msgspec.DecodeError:  # it died in the middle of a line
            return None

    def _pass_errors_on(self) -> None:
        """Print what it writes to standard error."""
        for line in self._error_output:
            print(line.decode(errors="replace"), end="", file=sys.stderr, flush=True)
