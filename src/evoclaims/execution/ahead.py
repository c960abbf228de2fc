"""Trials that processes run ahead of the claims that read them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

from evoclaims.claims.fetching import more_for_drift
from evoclaims.claims.workload import Workload, soonest_first
from evoclaims.core.errors import UserError
from evoclaims.execution.host import Host, seeing_only
from evoclaims.execution.job import Job, MissingBatch
from evoclaims.execution.worker import Ended, WorkOrder
from evoclaims.execution.workers import Seat, StoppedError, Workers, in_queue, seats_of
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials import devices
from evoclaims.trials.batches import StoredTrials
from evoclaims.trials.failed import remember
from evoclaims.trials.spec import Condition
from evoclaims.trials.stopping import LOOK_SECONDS
from evoclaims.trials.store import Store


@dataclass(frozen=True)
class TierRun:
    """What is run of a tier.

    Attributes:
        order: of its worker processes.
        seats: of these.
        groups: its batches, in the order in which the processes take them.
        conditions: ids by batch.
    """

    order: WorkOrder
    seats: Sequence[Seat]
    groups: Sequence[Sequence[Job]]
    conditions: Mapping[Job, str]

    def ends(self, load: Workload, began: float) -> dict[str, float]:
        """Return when each condition will have ended, by id, in seconds; the processes begin at `began`."""
        free, found = [began] * len(self.seats), dict[str, float]()
        for group in self.groups:
            seat = free.index(min(free))
            for job in group:
                free[seat] += load.conditions[self.conditions[job]].seconds
                found[self.conditions[job]] = free[seat]
        return found


@dataclass
class Ahead:
    """Runs the missing trials of a run's claims in processes of their own, while the claims wait for theirs.

    Attributes:
        host: the processes and GPUs that may be used.
        order: what all conditions have in common; jobs name their own seeds.
        reproduction: has the conditions.
        store: where trials are kept.
        limit: seconds that a batch may take.
        warn: receives what is to be known of processes that have died.
        processes: how many run trials, at least one; known once they have started.
    """

    host: Host
    order: WorkOrder
    reproduction: Reproduction
    store: Store
    limit: float
    warn: Callable[[str], None]
    processes: int = 1
    _ended: dict[str, threading.Event] = field(default_factory=dict)
    _errors: dict[str, str] = field(default_factory=dict)
    _broken: BaseException | None = None
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _workers: Workers | None = None
    _stopping: bool = False
    _thread: threading.Thread | None = None

    @property
    def platform(self) -> str:
        """Where trials run: "cpu" or "gpu"."""
        return "gpu" if self.host.gpus else devices.choose(self.order.device)[0].platform

    def start(self, load: Workload, seeds: Mapping[str, Sequence[int]]) -> list[str]:
        """Begin to run what claims lack; return the claims in the order in which their trials should be there.

        Args:
            load: the claims and what they lack.
            seeds: those that are run ahead, by tier: those of its design, and with them those for the drift check. A
                third look's are run when it is due.
        """
        claims = soonest_first(load)
        lacking = (claim for claim in claims if any(load.conditions[name].missing for name in load.claims[claim]))
        soonest = load.claims.get(next(lacking, ""), ())
        runs, ends = list[TierRun](), dict[str, float]()
        for tier in seeds:
            run = self._planned(load, tier, seeds, soonest)
            if run.seats:
                runs.append(run)
                ends |= run.ends(load, max(ends.values(), default=0.0))
        self.processes = max((len(run.seats) for run in runs), default=1)
        self._ended = {name: threading.Event() for name in ends}
        if runs:
            self._thread = threading.Thread(target=self._run, args=(runs,), daemon=True)
            self._thread.start()
        return sorted(claims, key=lambda one: max((ends.get(name, 0.0) for name in load.claims[one]), default=0.0))

    def wait(self, condition: Condition, seeds: Sequence[int]) -> None:
        """Wait until the trials of a condition are stored; what is not run ahead is run now.

        Raises:
            UserError: when they cannot be run.
        """
        if condition.id in self._ended:
            while not self._ended[condition.id].wait(LOOK_SECONDS):  # see `next_of`
                pass
        if self._broken is not None:
            raise self._broken
        stored = StoredTrials(self.store, condition, self.order.any_version, self.limit)
        if not (missing := stored.missing(seeds)):
            return
        error = self._errors.get(condition.id, "")
        if not error:
            error = self._run_now(condition, missing).error
            if not error and stored.missing(seeds):  # this process must not run them: it may be kept off GPUs
                error = (
                    "worker processes have run other trials than the claim needs: the project was edited after this "
                    "run had begun, or its settings differ from process to process; run it again"
                )
        if error:
            raise UserError(error)

    def stop(self) -> None:
        """End all processes; checkpoints let another run go on."""
        with self._lock:
            self._stopping = True
            if self._workers is not None:
                self._workers.stop()
        if self._thread is not None:
            with suppress(RuntimeError):  # an interrupt came before it was started
                self._thread.join()

    def _planned(
        self, load: Workload, tier: str, seeds: Mapping[str, Sequence[int]], soonest: Sequence[str]
    ) -> TierRun:
        """Return what is to be run by a tier's names: first what the soonest claim needs, then the longest.

        What another tier needs, too, is run by the first tier, for both.
        """
        works = {name: work for name, work in load.conditions.items() if work.tiers[0] == tier}
        known, platform = self.reproduction.seeds_for_drift, self.platform
        due = {name: {seed for one in work.tiers for seed in seeds[one]} for name, work in works.items()}
        for name, read in due.items():
            read.update(more_for_drift(known, name, [*read], self.limit, platform))
        asked = {name: tuple(seed for seed in work.missing if seed in due[name]) for name, work in works.items()}
        jobs = {Job("", *works[name].names, missing): name for name, missing in asked.items() if missing}
        batches = [MissingBatch(job, job.seeds, works[name].cost) for job, name in jobs.items()]
        batches.sort(key=lambda batch: -batch.cost.seconds())
        seats = seats_of(self.host, batches)
        first = tuple(job for job, name in jobs.items() if name in soonest)
        others = [batch for batch in batches if batch.job not in first]
        conditions = self.reproduction.tier(tier, self.order.variant).conditions
        groups = [*filter(None, [first]), *in_queue(others, conditions, len(seats))]
        return TierRun(replace(self.order, tier=tier), seats, groups, jobs)

    def _run(self, runs: Sequence[TierRun]) -> None:
        try:
            for run in runs:
                for ended in self._started(run.order, run.seats).run(run.groups):
                    name, tier = run.conditions[ended.job], self.reproduction.tier(run.order.tier, self.order.variant)
                    self._note_crashes(tier.condition(*ended.job.names), ended.job.seeds)
                    self._errors[name] = ended.error
                    self._ended[name].set()
        except StoppedError:
            pass
        except BaseException as error:  # whoever waits raises it
            self._broken = error
        for event in self._ended.values():
            event.set()

    def _note_crashes(self, condition: Condition, seeds: Sequence[int]) -> None:
        """Take trials that have crashed in a worker for this run's own: it does not begin them again."""
        for result in StoredTrials(self.store, condition, self.order.any_version, self.limit).sound(seeds):
            if result.status == "crashed":
                remember(result)

    def _started(self, order: WorkOrder, seats: Sequence[Seat]) -> Workers:
        with self._lock:
            if self._stopping:
                raise StoppedError
            self._workers = Workers(order, seats, lambda text: None, self.warn)
            return self._workers

    def _run_now(self, condition: Condition, seeds: Sequence[int]) -> Ended:
        """Run trials that were not run ahead: of a further look, or of a claim that cannot be called without trials."""
        for tier in self.reproduction.tiers:
            for names, one in self.reproduction.tier(tier, self.order.variant).conditions.items():
                if one.id == condition.id:
                    if self.host.gpus and self._thread is not None:
                        self._thread.join()  # whose processes have these GPUs' memory
                    seat = Seat(seeing_only(self.host.gpus) if self.host.gpus else {})
                    workers = Workers(replace(self.order, tier=tier), [seat], lambda text: None, self.warn)
                    (ended,) = workers.run([[Job("", *names, tuple(seeds))]])
                    self._note_crashes(one, seeds)
                    return ended
        raise UserError(f"{condition.label} is no condition of the paper, so that no process can run it.")
