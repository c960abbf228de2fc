"""What one job of `evoclaims submit` does: `evoclaims run` for each of its batches, in a process of its own.

submitit pickles an instance, which holds text alone, and loads it where the job runs: this module imports neither jax
nor the project.
"""

from __future__ import annotations

import contextlib
import os
import shlex
import signal
import time
from collections.abc import Sequence
from typing import Any, Final

INTERRUPTED: Final = 130
"""What `evoclaims run` ends with when it was interrupted."""

PATIENCE: Final = 40.0
"""Seconds that a batch is given to write its checkpoint before it is killed; it is asked `SIGNAL_SECONDS` before."""

SIGNAL_SECONDS: Final = 90
"""How long before its time limit a job is warned; a job of a few minutes is warned later."""

POLL_SECONDS: Final = 0.1


class BatchJob:
    """Batches that one job runs, one after the other."""

    def __init__(self, commands: Sequence[Sequence[str]], folder: str) -> None:
        """Run nothing yet: `commands`, one for each batch, will run in `folder`."""
        self.commands = [list(command) for command in commands]
        self.folder = folder
        self.process = 0

    def __call__(self) -> None:
        """Run all batches; a process that fails or dies does not stop the others.

        Raises:
            RuntimeError: at the end, when a batch has failed: the scheduler shows the job as failed then.
        """
        os.chdir(self.folder)
        failed = 0
        for command in self.commands:
            status = self._run(command)
            if status == INTERRUPTED:
                # The scheduler has warned all processes of the job that it takes the machine back. It warns this one
                # whether the job goes on later (see `checkpoint`), or kills it.
                time.sleep(PATIENCE)
                raise RuntimeError("The job was interrupted.")
            if status < 0:
                print(f"evoclaims: the process died of {signal.Signals(-status).name}.", flush=True)
            failed += status != 0
        if failed:
            raise RuntimeError(f"{failed} of {len(self.commands)} batches failed; the lines above say why.")

    def checkpoint(self) -> Any:
        """End the running batch with a checkpoint, and return what submitit is to start again: this job."""
        from submitit.helpers import DelayedSubmission

        if self.process:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.process, signal.SIGTERM)
            until = time.monotonic() + PATIENCE
            while _status(self.process, os.WNOHANG) is None:
                if time.monotonic() > until:
                    os.kill(self.process, signal.SIGKILL)
                    _status(self.process)
                    break
                time.sleep(POLL_SECONDS)
        self.process = 0
        return DelayedSubmission(self)

    def _run(self, command: list[str]) -> int:
        """Run a command and return its status."""
        print(f"$ {shlex.join(command)}", flush=True)
        # SLURM signals all processes of a job shortly before its time limit. The batch would die of that signal: it is
        # blocked there, and `checkpoint` alone passes it on. (A `subprocess.Popen` has locks, and may not be waited for
        # in a signal's handler while it is waited for outside.)
        self.process = os.posix_spawn(command[0], command, os.environ, setsigmask=[signal.SIGUSR2])
        status = _status(self.process)
        self.process = 0
        return status or 0


def _status(process: int, flags: int = 0) -> int | None:
    """Return the status of a child process, minus a signal's number if it died of one; None while it runs (WNOHANG)."""
    try:
        ended, status = os.waitpid(process, flags)
    except ChildProcessError:
        return 0
    return os.waitstatus_to_exitcode(status) if ended else None
