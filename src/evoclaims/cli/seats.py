"""How many worker processes a command starts on this host, and which of its GPUs each of them sees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from evoclaims.cli.missing import MissingBatch
from evoclaims.core.errors import UserError
from evoclaims.mutants.conditions import Job
from evoclaims.trials import devices, gpus

AUTO: Final = 0
"""As many processes as are useful."""


@dataclass(frozen=True)
class Seat:
    """A place for one worker process at a time.

    Attributes:
        environment: what its process sets.
        first: a condition that it runs before all others, if any.
        then: the seats that it becomes when that has ended: one for each of its GPUs.
    """

    environment: Mapping[str, str] = field(default_factory=dict)
    first: Job | None = None
    then: tuple[Seat, ...] = ()


@dataclass(frozen=True)
class Host:
    """What a command may use of this host.

    Attributes:
        processes: how many are asked for; 0 for as many as are useful.
        gpus: the GPUs that they share; empty on processors.
    """

    processes: int
    gpus: tuple[str, ...]

    @property
    def alone(self) -> bool:
        """Whether this process runs everything, on all devices."""
        return self.processes == 1 or (self.processes == AUTO and len(self.gpus) == 1)

    def seats(self, batches: Sequence[MissingBatch]) -> list[Seat]:
        """Return the seats of the processes that run some batches; none where there is nothing to run."""
        if not batches:
            return []
        if self.gpus and self.processes == AUTO:
            return _a_gpu_each(self.gpus, batches)
        if self.gpus:
            return [Seat(environment) for environment in gpus.shared(self.gpus, self.processes)]
        processes = self.processes or useful_processes(batches, devices.usable_cores())
        return [Seat() for _ in range(min(processes, len(batches)))]


def host_of(numprocesses: str, device: str) -> Host:
    """Return what a command may use; if processes are to share GPUs, jax in this process keeps off these.

    Raises:
        UserError: for a number of processes that is none.
    """
    if numprocesses != "auto" and (not numprocesses.isdecimal() or int(numprocesses) < 1):
        raise UserError(
            f"--numprocesses takes a number from 1 up, or auto (one for each GPU; without GPUs as many as the cores "
            f"are enough for), not {numprocesses!r}."
        )
    host = Host(AUTO if numprocesses == "auto" else int(numprocesses), gpus.gpus(device))
    if host.gpus and not host.alone:
        devices.keep_off_gpus()
    return host


def useful_processes(batches: Sequence[MissingBatch], cores: int) -> int:
    """Return how many processes keep some cores busy: compiling takes one, running as many as there are trials."""
    alone = sum(batch.estimate.seconds() for batch in batches)
    in_parallel = sum(batch.estimate.seconds(cores) for batch in batches)
    return max(round(cores * in_parallel / alone), 1)


def _a_gpu_each(found: Sequence[str], batches: Sequence[MissingBatch]) -> list[Seat]:
    """Return a seat for each GPU, save for batches that would take two GPUs' share or more: these have several.

    A batch that takes k shares of the whole time has k GPUs, which are single seats when it has ended. So no more GPUs
    are asked for than there are.
    """
    share, free, seats = sum(batch.estimate.seconds() for batch in batches) / len(found), list(found), []
    for batch in batches:
        wide = min(int(batch.estimate.seconds() / share), batch.estimate.trials, len(free))
        if wide < 2:
            continue
        taken, free = free[:wide], free[wide:]
        seats.append(Seat(gpus.only(taken), batch.job, tuple(Seat(gpus.only([one])) for one in taken)))
    return [*seats, *(Seat(gpus.only([one])) for one in free)]
