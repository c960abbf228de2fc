"""Missing trials of conditions, run by this process or by several, as `--numprocesses` says."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from evoclaims.claims.fetching import RunMissing
from evoclaims.cli.processes.host import Host
from evoclaims.cli.processes.job import Job, missing_batches
from evoclaims.cli.processes.worker import Ended, WorkOrder, run_jobs
from evoclaims.cli.processes.workers import Workers, in_queue, seats_of
from evoclaims.cli.project import Project
from evoclaims.cli.terminal import terminal
from evoclaims.report.live_line import LiveLine, duration
from evoclaims.trials import devices
from evoclaims.trials.spec import Condition


@dataclass(frozen=True)
class Execution:
    """How a command runs trials: whose, in which order, and with which processes and GPUs."""

    project: Project
    order: WorkOrder
    host: Host
    line: LiveLine = field(default_factory=lambda: LiveLine(*terminal()))

    @property
    def limit(self) -> float:
        """Seconds that a batch may take."""
        return self.project.config.seconds(self.order.time_limit)

    @property
    def device(self) -> str:
        """What this process itself may look at: GPUs that workers share are theirs alone."""
        return "cpu" if self.host.gpus and not self.host.alone else self.order.device

    @property
    def platform(self) -> str:
        """Where trials run: "cpu" or "gpu"."""
        return "gpu" if self.host.gpus else devices.choose(self.device)[0].platform

    def check(self) -> None:
        """Check before the first trial that the store can be written and the device exists; raise a `UserError`."""
        RunMissing(self.project.store, self.device, self.line, self.limit).check()

    def run(self, wanted: Mapping[Job, Condition], tell: Callable[[str], None]) -> Iterator[Ended]:
        """Run what the store lacks of some conditions, and yield each when it has ended; say which have failed.

        With several processes those that lack nothing come first, then each as it ends, with a line on the time left.

        Args:
            wanted: the conditions.
            tell: receives the progress of worker processes; a process that runs everything draws its line.
        """
        alone = run_jobs(self.project, self.order, wanted, self.line)
        for ended in alone if self.host.alone else self._in_processes(wanted, tell):
            if ended.error:
                print(f"evoclaims: {ended.job.label} ({self.order.tier}) failed: {ended.error}.", file=sys.stderr)
            yield ended

    def _in_processes(self, wanted: Mapping[Job, Condition], tell: Callable[[str], None]) -> Iterator[Ended]:
        seeds, tier = self.order.seeds, self.order.tier
        batches = missing_batches(self.project, tier, wanted, seeds, self.limit, self.platform)
        seconds = {batch.job: batch.cost.seconds() for batch in batches}
        yield from (Ended(job) for job in wanted if job not in seconds)
        seats = seats_of(self.host, batches)
        sound = self.project.reproduction.tier(tier, self.order.variant).conditions
        total, done, began = sum(seconds.values()), 0.0, time.monotonic()
        ended_jobs = Workers(self.order, seats, tell).run(in_queue(batches, sound, len(seats)))
        for number, ended in enumerate(ended_jobs, start=1):
            done += seconds[ended.job]
            left = (time.monotonic() - began) * (total - done) / max(done, 1e-9)
            print(
                f"  {number} of {len(batches)} conditions have ended, {duration(left)} left: {ended.job.label}",
                flush=True,
            )
            yield ended
