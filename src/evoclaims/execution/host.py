"""What may be used of this host: how many processes, and which GPUs; found without jax.

It is found out before the project is imported: libraries make arrays as they are imported, and with the first array jax
takes most of a GPU's memory. What a process sees is decided by its environment before jax starts there: this is how
several processes of a host share its GPUs.
"""

from __future__ import annotations

import importlib.metadata
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file

VISIBLE: Final = "CUDA_VISIBLE_DEVICES"
MEMORY: Final = "XLA_PYTHON_CLIENT_MEM_FRACTION"
"""The share of a GPU's memory that jax takes when it starts: three quarters, unless it is configured otherwise."""

SHARED_MEMORY: Final = 0.9
"""What several processes on one GPU take of its memory together."""

WITH_MPS: Final = 2
"""Processes for a GPU where NVIDIA's MPS runs; without it they take turns, and two are slower than one."""

_NODES: Final = Path("/dev")
_PROCESSES: Final = Path("/proc")
_DAEMON: Final = "nvidia-cuda-mps-control"

AUTO: Final = 0
"""As many processes as are useful."""


@dataclass(frozen=True)
class Host:
    """What a command or a run of claims may use of this host.

    Attributes:
        processes: how many are asked for; 0 for as many as are useful.
        gpus: the GPUs that they share; empty on processors.
        together: processes for each GPU, where conditions are more than GPUs and no number is asked for.
    """

    processes: int
    gpus: tuple[str, ...]
    together: int = 1

    @property
    def alone(self) -> bool:
        """Whether this process runs everything, on all devices."""
        return self.processes == 1 or (self.processes == AUTO and len(self.gpus) * self.together == 1)


def processes_of(numprocesses: str, option: str = "--numprocesses") -> int:
    """Return how many processes are asked for (see `Host`).

    Raises:
        UserError: for an invalid number.
    """
    if numprocesses != "auto" and (not numprocesses.isdecimal() or int(numprocesses) < 1):
        raise UserError(
            f"{option} takes a number from 1 up, or auto (one for each GPU, two where NVIDIA's MPS runs; without GPUs "
            f"as many as the cores are enough for), not {numprocesses!r}."
        )
    return AUTO if numprocesses == "auto" else int(numprocesses)


def host_of(numprocesses: str, device: str, option: str = "--numprocesses") -> Host:
    """Return what may be used; if processes are to share GPUs, jax in this process keeps off these.

    Raises:
        UserError: for an invalid number of processes.
    """
    processes, found = processes_of(numprocesses, option), gpus(device)
    host = Host(processes, found, WITH_MPS if found and mps_runs() else 1)
    if host.gpus and not host.alone:
        from evoclaims.trials import devices  # here, since it imports jax: pytest checks an option with this module

        devices.keep_off_gpus()
    return host


def gpus(device: str) -> tuple[str, ...]:
    """Return the GPUs that jax would use for `device` ("auto", "cpu" or "gpu"), as CUDA_VISIBLE_DEVICES names them.

    Empty where jax has no plugin for CUDA, or JAX_PLATFORMS asks for other hardware.
    """
    asked = {name.strip() for name in os.environ.get("JAX_PLATFORMS", "").split(",")} - {""}
    if device == "cpu" or (asked and not asked & {"cuda", "gpu"}):
        return ()
    if not any("cuda" in plugin.name for plugin in importlib.metadata.entry_points(group="jax_plugins")):
        return ()
    named = os.environ.get(VISIBLE)
    if named is not None:
        return tuple(name.strip() for name in named.split(",") if name.strip() not in ("", "-1", "NoDevFiles"))
    nodes = [path for path in _NODES.glob("nvidia*") if re.fullmatch(r"nvidia\d+", path.name)]
    return tuple(map(str, range(len(nodes))))  # CUDA numbers those that it may open from 0


def mps_runs() -> bool:
    """Whether NVIDIA's MPS runs here for this user: it lets several processes use a GPU at the same time."""
    folder = Path(os.environ.get("CUDA_MPS_PIPE_DIRECTORY") or "/tmp/nvidia-mps")  # noqa: S108  # MPS's own default
    try:
        process = _PROCESSES / str(int(read_file(folder / f"{_DAEMON}.pid")))
        return process.stat().st_uid in (0, os.getuid()) and _DAEMON in read_file(process / "cmdline").decode()
    except (OSError, ValueError):  # nobody has that number now, or the file is nonsense
        return False


def sharing_gpus(found: Sequence[str], processes: int) -> list[dict[str, str]]:
    """Return the environment of each of several processes that share some GPUs (at least one).

    Each has GPUs of its own, or several share one and its memory; a share that the user has set stays.
    """
    if processes <= len(found):
        return [seeing_only(found[process::processes]) for process in range(processes)]
    crowds = [len(range(place, processes, len(found))) for place in range(len(found))]
    memory = [{} if MEMORY in os.environ else {MEMORY: f"{SHARED_MEMORY / crowd:.3f}"} for crowd in crowds]
    places = [process % len(found) for process in range(processes)]
    return [seeing_only([found[place]]) | (memory[place] if crowds[place] > 1 else {}) for place in places]


def seeing_only(found: Sequence[str]) -> dict[str, str]:
    """Return the environment of a process that sees these GPUs alone."""
    return {VISIBLE: ",".join(found)}
