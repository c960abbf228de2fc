"""How many worker processes a command starts on this host, and which of its GPUs each of them sees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from evoclaims.cli.processes.host import AUTO, Host
from evoclaims.cli.processes.job import Job
from evoclaims.cli.processes.missing_batches import MissingBatch
from evoclaims.trials import devices, gpus


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


def seats_of(host: Host, batches: Sequence[MissingBatch]) -> list[Seat]:
    """Return the seats of the processes that run some batches; none where there is nothing to run."""
    if not batches:
        return []
    if host.gpus and host.processes == AUTO:
        return _a_gpu_each(host.gpus, batches)
    if host.gpus:
        return [Seat(environment) for environment in gpus.shared(host.gpus, host.processes)]
    processes = host.processes or useful_processes(batches, devices.usable_cores())
    return [Seat() for _ in range(min(processes, len(batches)))]


def useful_processes(batches: Sequence[MissingBatch], cores: int) -> int:
    """Return how many processes keep some cores busy: compiling takes one, running as many as there are trials."""
    alone = sum(batch.cost.seconds() for batch in batches)
    in_parallel = sum(batch.cost.seconds(cores) for batch in batches)
    return max(round(cores * in_parallel / alone), 1)


def _a_gpu_each(found: Sequence[str], batches: Sequence[MissingBatch]) -> list[Seat]:
    """Return a seat for each GPU, save for batches that would take two GPUs' share or more: these have several.

    A batch that takes k shares of the whole time has k GPUs, which are single seats when it has ended. So no more GPUs
    are asked for than there are.
    """
    share, free, seats = sum(batch.cost.seconds() for batch in batches) / len(found), list(found), []
    for batch in batches:
        wide = min(int(batch.cost.seconds() / share), batch.cost.trials, len(free))
        if wide < 2:
            continue
        taken, free = free[:wide], free[wide:]
        seats.append(Seat(gpus.only(taken), batch.job, tuple(Seat(gpus.only([one])) for one in taken)))
    return [*seats, *(Seat(gpus.only([one])) for one in free)]
