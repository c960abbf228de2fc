"""Processes that were forked while jax ran: its threads are not there any more, so that computations wait for ever.

This module imports no jax, and is imported with the package: it has to be there before the fork.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress

from evoclaims.core.errors import UserError

_forked_with_jax = False


def refuse_forked() -> None:
    """Check that jax can compute in this process.

    Raises:
        UserError: when the process was forked after jax had started.
    """
    if _forked_with_jax:
        raise UserError(
            "This process was forked from one in which jax had started, so jax would wait forever. Run "
            "trials in new processes: leave out --forked (pytest-forked) and os.fork(), use "
            "multiprocessing's start method spawn, or run claims by --claims-processes 4."
        )


def _jax_runs() -> bool:
    """Whether jax has started in this process; without its lock, which another thread may have held at the fork."""
    return bool(getattr(sys.modules.get("jax._src.xla_bridge"), "_backends", None))


def _note() -> None:
    global _forked_with_jax
    _forked_with_jax = _forked_with_jax or _jax_runs()


os.register_at_fork(after_in_child=_note)
with suppress(OSError):  # imported after the fork: jax's threads would be among those of the process
    _forked_with_jax = _jax_runs() and len(os.listdir("/proc/self/task")) == 1
