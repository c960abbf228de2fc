"""Reading the command line, and ending every user error with one sentence."""

from __future__ import annotations

import argparse
import atexit
import contextlib
import importlib
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from evoclaims.cli.arguments import IN_PROCESSES, parser
from evoclaims.cli.terminal import OutputError, plain_output
from evoclaims.core.errors import UserError, require_known
from evoclaims.trials.stopping import end_without, interrupted_by

USER_ERROR, INTERRUPTED, CLOSED_PIPE = 2, 130, 141


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0, the command's own, or 2 for a user error."""
    try:
        with plain_output():
            status = _ended(arguments)
    except BrokenPipeError:  # `evoclaims status | head`: the reader has seen enough
        _print_no_more()
        status = CLOSED_PIPE
    except OutputError as error:  # `evoclaims status > table.txt` on a full disk
        with contextlib.suppress(OSError):
            print(f"evoclaims: {error}", file=sys.stderr)
        _print_no_more()
        status = USER_ERROR
    end_without(status)
    return status


def _print_no_more() -> None:
    """Let what is not printed yet go nowhere: the interpreter would try again as it ends, and fail."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in filter(None, (sys.stdout, sys.stderr)):
        with contextlib.suppress(OSError):  # a stream of a caller that has no file
            os.dup2(nowhere, stream.fileno())


def _ended(arguments: Sequence[str] | None) -> int:
    """Run one command to its end, or print the sentence that says why it failed."""
    options, unknown = parser().parse_known_args(arguments)
    if unknown:
        options.refuse(f"unrecognized arguments: {' '.join(unknown)}")
    try:
        with interrupted_by(signal.SIGINT), interrupted_by(signal.SIGTERM):
            return _done(options)
    except UserError as error:
        print(f"evoclaims: {error}", file=sys.stderr)
        return USER_ERROR
    except KeyboardInterrupt:
        if alone := arguments is None:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        runs = getattr(options, "run", True) and not getattr(options, "stored", False)  # `power` alone runs nothing
        trains = options.command in IN_PROCESSES and runs
        goes_on = "; the same command goes on from the last checkpoint" if trains else ""
        print(f"\nevoclaims: interrupted{goes_on}.", file=sys.stderr)
        if alone:
            _end_at_the_next()
        return INTERRUPTED
    except Exception as error:
        if sentence := _raised_in_project(error):
            print(f"evoclaims: {sentence}.", file=sys.stderr)
            return USER_ERROR
        raise


def _end_at_the_next() -> None:
    """Let another Ctrl-C end this interrupted process at once; else it is a traceback, or the process ends by a signal.

    As it ends, the interpreter forgets a handler, but not that a signal is ignored.
    """
    signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)  # when threads are waited for no longer


def _raised_in_project(error: Exception) -> str:
    """Return in one line what the project's own code has raised; empty for an error that may be of evoclaims."""
    from evoclaims.core.errors import in_one_line, is_of_project
    from evoclaims.core.printable import printable
    from evoclaims.paper.config import find_root

    try:
        root = find_root(Path.cwd())
    except (UserError, OSError):
        return ""
    return printable(in_one_line(error, root)) if is_of_project(error, root) else ""


def _done(options: argparse.Namespace) -> int:
    _check_folder()
    from evoclaims.cli.store_folder import storage_of

    if getattr(options, "device", "auto") != "auto":  # before a folder is made, or a job is submitted
        from evoclaims.trials.devices import DEVICE_NAMES

        require_known("device", options.device, DEVICE_NAMES)
    options.storage = storage_of(options.storage, options.command)
    if "numprocesses" in options:
        from evoclaims.execution.host import host_of

        options.host = host_of(options.numprocesses, options.device)
    command = importlib.import_module(f"evoclaims.cli.{options.command}")  # only now: --help waits for no jax
    status: int = command.main(options)
    sys.stdout.flush()
    return status


def _check_folder() -> None:
    """Raise a `UserError` when the current folder is gone, with which every command begins."""
    try:
        os.getcwd()
    except OSError as error:
        raise UserError(
            f"The current folder cannot be used ({error.strerror or error}). If it was deleted and "
            "created again, enter it again (cd .)."
        ) from error
