"""Which conditions a command runs, and how: in this process or in several."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from evoclaims.claims.fetching import RunMissing
from evoclaims.cli.project import Project
from evoclaims.cli.terminal import terminal
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.execution.host import Host
from evoclaims.execution.job import Job, missing_batches
from evoclaims.execution.worker import Ended, Opened, WorkOrder, run_jobs
from evoclaims.execution.workers import Workers, in_queue, seats_of
from evoclaims.judging.exact import MAX_TRIALS
from evoclaims.paper.reproduction import Names, Tier
from evoclaims.report.formatting import plural
from evoclaims.report.live_line import LiveLine, duration
from evoclaims.trials import devices
from evoclaims.trials.spec import Condition


def choose(project: Project, options: argparse.Namespace) -> tuple[Tier, list[Names]]:
    """Return the tier that options name, and which of its conditions they select; of a variant, what it changes.

    Without any name these are what the tier's claims need, and a line counts the others.

    Raises:
        UserError: for an unknown name, and for conditions that the variant leaves as they are; it lists the known ones.
            Without any name also when the claims cannot be collected.
    """
    reproduction = project.reproduction
    tier = reproduction.tier(options.tier, options.variant)
    chosen = named(tier, options.method, options.on)
    if not options.variant:
        return tier, chosen if options.method or options.on else _needed(project, options.tier, chosen)
    touched = reproduction.changed_by(options.variant, options.tier)
    chosen = [names for names in chosen if names in touched]
    if not chosen:
        raise UserError(
            f"The variant {options.variant} changes none of these conditions at the {options.tier} tier; it changes: "
            f"{', '.join(sorted(' on '.join(names) for names in touched)) or 'none'}."
        )
    return tier, chosen


def trials_asked(options: argparse.Namespace, tier: Tier) -> int:
    """Return how many trials of each condition options ask for: the tier's, unless they name a number.

    Raises:
        UserError: for a number that no verdict reads.
    """
    n: int = tier.design.last.n if options.trials is None else options.trials
    if not 1 <= n <= MAX_TRIALS:
        raise UserError(
            f"--trials takes 1 to {MAX_TRIALS} trials per condition (no verdict reads more), not {n}. Run "
            "further seeds by `evoclaims run` with --first-seed."
        )
    return n


def _needed(project: Project, tier: str, known: Sequence[Names]) -> list[Names]:
    """Return the conditions that claims of a tier need; a claim whose test breaks needs what it has asked for."""
    try:
        (claims,) = project.collect([("", tier)])
    except UserError as error:
        example = f", as in {' --on '.join(known[0])}" * bool(known)
        raise UserError(f"{error} Without claims only named conditions run{example}.") from error
    needed = {names for one in claims for names in (one.groups or [(group.method, group.task) for group in one.asked])}
    others = [names for names in known if names not in needed]
    if others:
        print(
            f"Left out: {plural(len(others), 'condition')} that no claim of the {tier} tier needs; names select them, "
            f"as in {others[0][0]} --on {others[0][1]}.",
            flush=True,
        )
    return [names for names in known if names in needed]


def named(tier: Tier, method: str | None, task: str | None) -> list[Names]:
    """Return the conditions that a method and a task select; an error for an unknown name lists the known ones.

    An `optional` method, which needs packages that may not be installed, runs only when it is named.
    """
    if method is not None and task is not None:
        tier.condition(method, task)
    known = list(tier.conditions)
    for name, position, kind in ((method, 0, "method"), (task, 1, "task")):
        if name is not None and name not in {names[position] for names in known}:
            raise UnknownNameError(kind, name, {names[position] for names in known})
    if method is None:
        known = [names for names in known if not getattr(tier.conditions[names].method, "optional", False)]
    return [names for names in known if method in (None, names[0]) and task in (None, names[1])]


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
        opened = Opened(self.project.config, self.project.reproduction, self.project.store)
        alone = run_jobs(opened, self.order, wanted, self.line)
        for ended in alone if self.host.alone else self._in_processes(wanted, tell):
            if ended.error:
                print(f"evoclaims: {ended.job.label} ({self.order.tier}) failed: {ended.error}.", file=sys.stderr)
            yield ended

    def _in_processes(self, wanted: Mapping[Job, Condition], tell: Callable[[str], None]) -> Iterator[Ended]:
        seeds, tier = self.order.seeds, self.order.tier
        store, reproduction = self.project.store, self.project.reproduction
        batches = missing_batches(store, reproduction, tier, wanted, seeds, self.limit, self.platform)
        seconds = {batch.job: batch.cost.seconds() for batch in batches}
        yield from (Ended(job) for job in wanted if job not in seconds)
        seats = seats_of(self.host, batches)
        sound = reproduction.tier(tier, self.order.variant).conditions
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
