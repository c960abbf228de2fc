"""Several worker processes that run conditions of one store; one that dies gives its condition back."""

from __future__ import annotations

import queue
import sys
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from typing import Final

from evoclaims.cli.processes.job import Job, sharing_programs
from evoclaims.cli.processes.missing_batches import MissingBatch
from evoclaims.cli.processes.seats import Seat
from evoclaims.cli.processes.worker import Ended, WorkOrder
from evoclaims.cli.processes.worker_process import Process
from evoclaims.paper.variant import Conditions

ATTEMPTS: Final = 3
"""How often a condition is begun whose process dies: the first may have been killed by chance."""

SMALL: Final = 1 / 8
"""Conditions that share programs are run by one process if they take less than this part of what each has to do."""


def in_queue(batches: Sequence[MissingBatch], sound: Conditions, processes: int) -> list[tuple[Job, ...]]:
    """Return conditions as processes take them, the longest first, so that the last ones end at about the same time.

    Small ones that probably share compiled programs stay together, since no two processes should compile the same.

    Args:
        batches: what is missing.
        sound: the tier's conditions.
        processes: how many will take them.
    """
    seconds = {batch.job: batch.cost.seconds() for batch in batches}
    enough = SMALL * sum(seconds.values()) / max(processes, 1)

    def total(group: Sequence[Job]) -> float:
        return sum(seconds[job] for job in group)

    groups = [tuple(group) for group in sharing_programs(seconds, sound)]
    kept = [group for group in groups if len(group) == 1 or total(group) <= enough]
    split = [(job,) for group in groups if group not in kept for job in group]
    return sorted([*kept, *split], key=total, reverse=True)


class Workers:
    """Runs conditions in a process for each seat, several at a time."""

    def __init__(self, order: WorkOrder, seats: Sequence[Seat], tell: Callable[[str], None]) -> None:
        """Start nothing yet; `tell` receives lines of progress."""
        self._order = order
        self._seats = seats
        self._tell = tell
        self._changed = threading.Condition()  # of all that follows
        self._left: deque[tuple[Job, ...]] = deque()
        self._running = 0
        self._taken = 0
        self._deaths: Counter[Job] = Counter()
        self._processes: set[Process] = set()
        self._threads: list[threading.Thread] = []
        self._stopping = False
        self._ended: queue.SimpleQueue[Ended | BaseException] = queue.SimpleQueue()

    def run(self, groups: Sequence[Sequence[Job]]) -> Iterator[Ended]:
        """Run groups of conditions in their order; yield each condition once, when it has ended."""
        expected = {job for group in groups for job in group}
        first = {seat.first for seat in self._seats}
        self._left.extend(filter(None, (tuple(job for job in group if job not in first) for group in groups)))
        try:
            self._sit(self._seats)
            while expected:
                ended = self._ended.get()
                if isinstance(ended, BaseException):
                    raise ended
                expected.discard(ended.job)
                yield ended
        finally:
            self._stop()

    def _sit(self, seats: Sequence[Seat]) -> None:
        """Start a thread for each seat."""
        with self._changed:
            self._taken += len(seats)
            self._running += sum(seat.first is not None for seat in seats)
            threads = [threading.Thread(target=self._work, args=(seat,), daemon=True) for seat in seats]
            self._threads += threads
            for thread in threads:
                thread.start()

    def _work(self, seat: Seat) -> None:
        """Run conditions until none is left, then become other seats; pass on what should not happen."""
        try:
            self._run_at(seat)
            self._sit(() if self._stopping else seat.then)
            with self._changed:
                self._taken -= 1
                lost = [] if self._taken else list(self._left)
            for job in (job for group in lost for job in group):
                self._ended.put(Ended(job, "no worker process could start", untried=True))
        except BaseException as error:
            self._ended.put(error)

    def _run_at(self, seat: Seat) -> None:
        """Run conditions in a process that is replaced when it dies; give up where none starts."""
        process, failures = None, 0
        group = self._next() if seat.first is None else (seat.first,)
        while group:
            process = process or self._started(seat)
            failures = 0 if process else failures + 1
            left = self._run(process, group) if process else group
            process = process if process in self._processes else None
            self._give_back(left)
            group = self._next() if seat.first is None and failures < ATTEMPTS else ()
        if process is not None:
            self._dismiss(process)

    def _next(self) -> tuple[Job, ...]:
        """Take the first group that is left; empty when all have ended: one that runs may yet be given back."""
        with self._changed:
            self._changed.wait_for(lambda: bool(self._left) or not self._running or self._stopping)
            if not self._left or self._stopping:
                return ()
            self._running += 1
            return self._left.popleft()

    def _give_back(self, left: tuple[Job, ...]) -> None:
        """Count a group as running no more, and put what has not ended in front of the others."""
        with self._changed:
            self._running -= 1
            if left:
                self._left.appendleft(left)
            self._changed.notify_all()

    def _started(self, seat: Seat) -> Process | None:
        """Start a process; None where it has died before it was ready."""
        process = Process(self._order, seat.environment)
        with self._changed:
            self._processes.add(process)
            late = self._stopping
        if late:
            process.stop()
        if process.is_ready():
            return process
        self._dismiss(process)
        if not self._stopping:
            print(f"evoclaims: a worker process did not start: {process.why()}.", file=sys.stderr, flush=True)
        return None

    def _run(self, process: Process, group: tuple[Job, ...]) -> tuple[Job, ...]:
        """Run a group in a process; return what is left of it where that has died."""
        for place, job in enumerate(group):
            ended = process.run(job, self._tell)
            if ended is not None:
                self._ended.put(ended)
                continue
            self._dismiss(process)
            if self._stopping:
                return group[place:]
            self._deaths[job] += 1
            died = f"its process died ({process.why()})"
            if self._deaths[job] < ATTEMPTS:
                print(f"evoclaims: {job.label}: {died}; it is begun again.", file=sys.stderr, flush=True)
                return group[place:]
            self._ended.put(Ended(job, f"{died}, {ATTEMPTS} times"))
            return group[place + 1 :]
        return ()

    def _dismiss(self, process: Process) -> None:
        """Wait for a process that has ended, or has nothing more to do."""
        process.close()
        with self._changed:
            self._processes.discard(process)

    def _stop(self) -> None:
        """End all processes: what they have stored stays, and checkpoints let another call go on."""
        with self._changed:
            self._stopping = True
            self._changed.notify_all()
            for process in self._processes:
                process.stop()
        for thread in self._threads:
            thread.join()
        for process in tuple(self._processes):  # those of threads that have failed
            self._dismiss(process)
