"""Missing trials of conditions, run by this process or by several; a worker that dies gives its condition back."""

from __future__ import annotations

import contextlib
import math
import os
import queue
import signal
import subprocess
import sys
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import IO, Any, Final

import msgspec

from evoclaims.execution.host import AUTO, Host, seeing_only, sharing_gpus
from evoclaims.execution.job import Job, MissingBatch, sharing_programs
from evoclaims.execution.worker import USER_ERROR, Ended, Reply, Told, WorkOrder
from evoclaims.paper.reproduction import Conditions
from evoclaims.trials import devices
from evoclaims.trials.stopping import next_of


class Process:
    """A process that runs one condition after the other, as it is asked to."""

    def __init__(self, order: WorkOrder, environment: Mapping[str, str]) -> None:
        """Start it, with these environment variables besides the command's own."""
        # A process inherits what is blocked here: Ctrl-C cannot end it before `worker.main` ignores it.
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "evoclaims.execution.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env={**os.environ, **environment},
                cwd=order.root,
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        process: Any = self._process
        pipes: tuple[IO[bytes], ...] = process.stdin, process.stdout, process.stderr
        self._input, self._output, self._error_output = pipes
        self._last_line = ""
        self._errors = threading.Thread(target=self._pass_errors_on, daemon=True)
        self._errors.start()
        self._ask(order)

    def is_ready(self) -> bool:
        """Wait until it can run conditions; False where it has died before."""
        return isinstance(self._reply(), Told)

    def run(self, job: Job, tell: Callable[[str], None]) -> Ended | None:
        """Run a condition to its end; None where the process died of it."""
        self._ask(job)
        while isinstance(reply := self._reply(), Told):
            tell(reply.text)
        return reply

    def why(self) -> str:
        """Return how it has ended, such as "status 7"; or what it has said, where the project cannot be opened."""
        status = self._process.wait()
        self._errors.join()
        if status == USER_ERROR and self._last_line:
            return self._last_line.rstrip(".")
        if status == -signal.SIGKILL:
            return "SIGKILL: the system sends that where memory runs out"
        return signal.Signals(-status).name if -status in set(signal.Signals) else f"status {status}"

    def close(self) -> None:
        """Give it nothing more to do, and wait for its end."""
        with contextlib.suppress(OSError):  # it is dead already
            self._input.close()
        self._process.wait()
        self._errors.join()
        self._output.close()
        self._error_output.close()

    def stop(self) -> None:
        """End it, whatever it does; it is still to be closed."""
        self._process.terminate()

    def _ask(self, what: WorkOrder | Job) -> None:
        """Write a line to its standard input; a dead process is found when it does not reply."""
        with contextlib.suppress(OSError):
            self._input.write(msgspec.json.encode(what) + b"\n")
            self._input.flush()

    def _reply(self) -> Reply | None:
        """Wait for its next reply; None where it has died."""
        line = self._output.readline()
        try:
            return msgspec.json.decode(line, type=Reply) if line else None
        except msgspec.DecodeError:  # it died in the middle of a line
            return None

    def _pass_errors_on(self) -> None:
        for line in self._error_output:
            text = line.decode(errors="replace")
            self._last_line = text.strip() or self._last_line
            with contextlib.suppress(OSError, ValueError):  # no room or no reader: the process must not wait for either
                print(text, end="", file=sys.stderr, flush=True)


ATTEMPTS: Final = 3
"""How often a condition is begun whose process dies: the first may have been killed by chance."""

SMALL: Final = 1 / 8
"""Conditions that share programs are run by one process if they take less than this part of what each has to do."""

TOO_IDLE: Final = 0.1
"""A process that would be busy for less than this part of the time is not worth its start."""

NEAR: Final = 6
"""Among how many groups, the longest first, a process looks for one whose task it has traced already."""


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


class StoppedError(Exception):
    """Work was stopped before its end."""


def _print_error(text: str) -> None:
    print(f"evoclaims: {text}", file=sys.stderr, flush=True)


class Workers:
    """Runs conditions in a process for each seat, several at a time."""

    def __init__(
        self,
        order: WorkOrder,
        seats: Sequence[Seat],
        tell: Callable[[str], None],
        warn: Callable[[str], None] = _print_error,
    ) -> None:
        """Start nothing yet; `tell` receives lines of progress, `warn` which processes have died."""
        self._order = order
        self._seats = seats
        self._tell = tell
        self._warn = warn
        self._changed = threading.Condition()  # of all that follows
        self._left: deque[tuple[Job, ...]] = deque()
        self._running = 0
        self._taken = 0
        self._deaths: Counter[Job] = Counter()
        self._processes: set[Process] = set()
        self._threads: list[threading.Thread] = []
        self._stopping = False
        self._why = ""  # the last process that did not start has ended
        self._ended: queue.SimpleQueue[Ended | BaseException] = queue.SimpleQueue()

    def run(self, groups: Sequence[Sequence[Job]]) -> Iterator[Ended]:
        """Run groups of conditions in their order; yield each condition once, when it has ended.

        Raises:
            StoppedError: when `stop` is called meanwhile.
        """
        expected = {job for group in groups for job in group}
        first = {seat.first for seat in self._seats}
        self._left.extend(filter(None, (tuple(job for job in group if job not in first) for group in groups)))
        try:
            self._sit(self._seats)
            while expected:
                ended = next_of(self._ended)
                if isinstance(ended, BaseException):
                    raise ended
                expected.discard(ended.job)
                yield ended
        finally:
            self._stop()

    def stop(self) -> None:
        """Let a run on another thread end with `StoppedError`."""
        self._ended.put(StoppedError())

    def _sit(self, seats: Sequence[Seat]) -> None:
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
                self._ended.put(Ended(job, f"no worker process could start: {self._why}", untried=True))
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
            known = group[-1].task if process else ""
            group = self._next(known) if seat.first is None and failures < ATTEMPTS else ()
        if process is not None:
            self._dismiss(process)

    def _next(self, known: str = "") -> tuple[Job, ...]:
        """Take the first group that is left; empty when all have ended: one that runs may yet be given back.

        One of the task that this process has `known` comes before those that are hardly longer: it need not be traced.
        """
        with self._changed:
            self._changed.wait_for(lambda: bool(self._left) or not self._running or self._stopping)
            if not self._left or self._stopping:
                return ()
            self._running += 1
            soon = list(self._left)[:NEAR]
            group = next((one for one in soon if one[0].task == known), soon[0])
            self._left.remove(group)
            return group

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
            self._why = process.why()
            self._warn(f"a worker process did not start: {self._why}.")
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
                self._warn(f"{job.label}: {died}; it is begun again.")
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
            with contextlib.suppress(RuntimeError):  # an interrupt came before it was started
                thread.join()
        for process in tuple(self._processes):  # those of threads that have failed
            self._dismiss(process)


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
        return _a_gpu_each(host.gpus, batches, host.together)
    if host.gpus:
        return [Seat(environment) for environment in sharing_gpus(host.gpus, host.processes)]
    processes = host.processes or useful_processes(batches, devices.usable_cores())
    return [Seat() for _ in range(min(processes, len(batches)))]


def useful_processes(batches: Sequence[MissingBatch], cores: int) -> int:
    """Return how many processes keep some cores busy: compiling takes one, running as many as there are trials."""
    alone = sum(batch.cost.seconds() for batch in batches)
    in_parallel = sum(batch.cost.seconds(cores) for batch in batches)
    return max(math.ceil(cores * in_parallel / alone - TOO_IDLE), 1)


def _a_gpu_each(found: Sequence[str], batches: Sequence[MissingBatch], together: int) -> list[Seat]:
    """Return a seat for each GPU, save for batches that would take two GPUs' share or more: these have several.

    A batch that takes k shares of the whole time has k GPUs, which are single seats when it has ended. So no more GPUs
    are asked for than there are. Where several processes use a GPU well and batches are more than GPUs, a GPU that no
    batch has to itself has `together` seats.
    """
    share, free, seats = sum(batch.cost.seconds() for batch in batches) / len(found), list(found), []
    for batch in batches:
        wide = min(int(batch.cost.seconds() / share), batch.cost.trials, len(free))
        if wide < 2:
            continue
        taken, free = free[:wide], free[wide:]
        seats.append(Seat(seeing_only(taken), batch.job, tuple(Seat(seeing_only([one])) for one in taken)))
    crowd = min(len(batches) - len(seats), len(free) * together)
    return [*seats, *(map(Seat, sharing_gpus(free, max(crowd, len(free)))) if free else ())]
