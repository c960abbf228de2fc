"""Several worker processes that run conditions of one store; one that dies gives its condition back."""

from __future__ import annotations

import queue
import sys
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from typing import Final

from evoclaims.cli.missing import MissingBatch
from evoclaims.cli.seats import Seat
from evoclaims.cli.worker import Ended, Order
from evoclaims.cli.worker_process import Process
from evoclaims.mutants.conditions import Job, sharing_programs
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
    seconds = {batch.job: batch.estimate.seconds() for batch in batches}
    enough = SMALL * sum(seconds.values()) / max(processes, 1)

    def total(group: Sequence[Job]) -> float:
        return sum(seconds[job] for job in group)

    groups = [tuple(group) for group in sharing_programs(seconds, sound)]
    kept = [group for group in groups if len(group) == 1 or total(group) <= enough]
    split = [(job,) for group in groups if group not in kept for job in group]
    return sorted([*kept, *split], key=total, reverse=True)


class Workers:
    """Runs conditions in a process for each seat, several at a time."""

    def __init__(self, order: Order, seats: Sequence[Seat], tell: Callable[[str], None]) -> None:
        """Start nothing yet.

        Args:
            order: what the conditions have in common.
            seats: where processes run.
            tell: is told lines of progress.
        """
        self._order = order
        self._seats = seats
        self._tell = tell
        self._left: deque[tuple[Job, ...]] = deque()
        self._deaths: Counter[Job] = Counter()
        self._ended: queue.SimpleQueue[Ended | None] = queue.SimpleQueue()
        self._processes: set[Process] = set()
        self._threads: list[threading.Thread] = []
        self._taken = 0
        self._lock = threading.Lock()
        self._stopping = False

    def run(self, groups: Sequence[Sequence[Job]]) -> Iterator[Ended]:
        """Run groups of conditions in their order; yield each condition once, when it has ended."""
        first = {seat.first for seat in self._seats}
        self._left.extend(filter(None, (tuple(job for job in group if job not in first) for group in groups)))
        expected = {job: None for group in groups for job in group}
        try:
            self._sit(self._seats)
            while expected:
                ended = self._ended.get()
                if ended is None:  # no seat is left
                    yield from (Ended(job, "no worker process could start") for job in expected)
                    return
                del expected[ended.job]
                yield ended
        finally:
            self._stop()

    def _sit(self, seats: Sequence[Seat]) -> None:
        """Start a thread for each seat."""
        with self._lock:
            self._taken += len(seats)
        for seat in seats:
            thread = threading.Thread(target=self._work, args=(seat,), daemon=True)
            self._threads.append(thread)
            thread.start()

    def _work(self, seat: Seat) -> None:
        """Run conditions until none is left; a process that dies is replaced, and a seat where none starts given up."""
        process, failures = None, 0
        group = self._next() if seat.first is None else (seat.first,)
        while group and failures < ATTEMPTS and not self._stopping:
            process = process or self._started(seat)
            if process is None:
                failures += 1
                continue
            failures = 0
            if self._run(process, group):
                process = None
            group = self._next() if seat.first is None else ()
        if group:
            self._give_back(group)
        if process is not None:
            self._dismiss(process)
        if seat.then and not self._stopping:
            self._sit(seat.then)
        with self._lock:
            self._taken -= 1
            if self._taken == 0:
                self._ended.put(None)

    def _next(self) -> tuple[Job, ...]:
        """Take the first of the groups that are left; empty where none is."""
        with self._lock:
            return self._left.popleft() if self._left else ()

    def _give_back(self, group: tuple[Job, ...]) -> None:
        """Put conditions back in front of the others."""
        if group:
            with self._lock:
                self._left.appendleft(group)

    def _started(self, seat: Seat) -> Process | None:
        """Start a process; None where it has died before it was ready."""
        process = Process(self._order, seat.environment)
        with self._lock:
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

    def _run(self, process: Process, group: tuple[Job, ...]) -> bool:
        """Run a group in a process; return whether that has died, and give back what it has not run."""
        for place, job in enumerate(group):
            ended = process.run(job, self._tell)
            if ended is not None:
                self._ended.put(ended)
                continue
            self._dismiss(process)
            if not self._stopping:
                self._deaths[job] += 1
                died = f"its process died ({process.why()})"
                if self._deaths[job] < ATTEMPTS:
                    print(f"evoclaims: {job.label}: {died}; it is begun again.", file=sys.stderr, flush=True)
                    self._give_back(group[place:])
                else:
                    self._ended.put(Ended(job, f"{died}, {ATTEMPTS} times"))
                    self._give_back(group[place + 1 :])
            return True
        return False

    def _dismiss(self, process: Process) -> None:
        """Wait for a process that has ended, or has nothing more to do."""
        process.close()
        with self._lock:
            self._processes.discard(process)

    def _stop(self) -> None:
        """End all processes: what they have stored stays, and checkpoints let another call go on."""
        with self._lock:
            self._stopping = True
            running = list(self._processes)
        for process in running:
            process.stop()
        for thread in self._threads:
            thread.join()
