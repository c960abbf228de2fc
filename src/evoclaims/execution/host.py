"""What may be used of this host: how many processes, and which GPUs.

It is found out before the project is imported: libraries make arrays as they are imported,
and with the first array jax takes most of a GPU's memory.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from evoclaims.core.errors import UserError
from evoclaims.trials import gpus

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
    processes, found = processes_of(numprocesses, option), gpus.gpus(device)
    host = Host(processes, found, gpus.WITH_MPS if found and gpus.mps_runs() else 1)
    if host.gpus and not host.alone:
        from evoclaims.trials import devices  # here, since it imports jax: pytest checks an option with this module

        devices.keep_off_gpus()
    return host
