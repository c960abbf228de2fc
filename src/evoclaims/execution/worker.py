"""The running of named conditions one after the other, in this process or in a worker process.

A worker (`python -m evoclaims.execution.worker`) reads a `WorkOrder` and then conditions from its standard input, a
line of JSON each, and answers on its standard output when each has ended; it judges nothing. It ends with its input.
"""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any, Final

import msgspec

from evoclaims.claims.fetching import RunMissing
from evoclaims.core.errors import StorageError, UserError, in_one_line
from evoclaims.core.printable import printable
from evoclaims.execution.job import Job, jobs
from evoclaims.mutants import mutant
from evoclaims.mutants.mutant import plantings
from evoclaims.paper.config import SuiteConfig, find_root, load_config, load_reproduction
from evoclaims.paper.reproduction import Reproduction
from evoclaims.report.live_line import LiveLine
from evoclaims.trials import devices
from evoclaims.trials.progress import RunProgress
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import Store

USER_ERROR: Final = 2

TOLD_SECONDS: Final = 60.0
"""Least time between two lines of progress about a condition: several processes write to one terminal."""


@dataclass(frozen=True)
class WorkOrder:
    """What the conditions that are run have in common.

    Attributes:
        storage: folder of the store.
        tier, device: as commands name them.
        first_seed, trials: of each condition.
        variant: of the protocol; empty for itself.
        time_limit: of a batch, as --time-limit says; None for the project's own.
        any_version: whether stored trials count whatever versions they were made with.
        root: the project's folder; None for that around the current one.
    """

    storage: str
    tier: str
    device: str
    first_seed: int
    trials: int
    variant: str = ""
    time_limit: str | None = None
    any_version: bool = False
    root: str | None = None

    @property
    def seeds(self) -> range:
        """The seeds of each condition."""
        return range(self.first_seed, self.first_seed + self.trials)


class Told(msgspec.Struct, frozen=True, tag=True):
    """A line of progress; empty when a worker is ready."""

    text: str = ""


class Ended(msgspec.Struct, frozen=True, tag=True):
    """A condition has ended.

    Attributes:
        job: which.
        error: why it failed, as a clause; empty where it did not.
        untried: its failure says nothing about it: nothing could be stored, or no process was there to run it.
        again: trials that were run again, since the stored ones were made with other versions.
    """

    job: Job
    error: str = ""
    untried: bool = False
    again: int = 0


Reply = Told | Ended


@dataclass(frozen=True)
class Opened:
    """A project as far as its conditions are run: its settings, its reproduction and where trials are kept."""

    config: SuiteConfig
    reproduction: Reproduction
    store: Store

    @classmethod
    def here(cls, storage: str) -> Opened:
        """Open the project around the current folder.

        Raises:
            UserError: when there is none, or something else than a store is in the folder `storage`.
        """
        devices.configure()
        config, store = load_config(find_root(Path.cwd())), Store(Path(storage))
        store.check()
        return cls(config, load_reproduction(config), store)


def condition_of(reproduction: Reproduction, order: WorkOrder, job: Job) -> Condition:
    """Return the condition that a job names.

    Raises:
        UserError: for unknown names.
    """
    sound = {job.names: reproduction.tier(order.tier, order.variant).condition(*job.names)}
    if not job.fault:
        return sound[job.names]
    return jobs(sound, plantings(sound, mutant.load(reproduction)))[job]


def run_jobs(opened: Opened, order: WorkOrder, asked: Iterable[Job], line: LiveLine) -> Iterator[Ended]:
    """Run the missing trials of conditions one after the other; an error in one does not stop the others."""
    limit = opened.config.seconds(order.time_limit)
    for job in asked:
        watch = _named(line, job)
        fetch = RunMissing(opened.store, order.device, watch, limit, order.any_version)
        try:
            condition = condition_of(opened.reproduction, order, job)
            with contextlib.closing(line):
                fetch(condition, job.seeds or order.seeds)
        except (KeyboardInterrupt, BrokenPipeError):  # the user, or the reader of the output, has stopped
            raise
        except BaseException as error:  # an error in a method or a task must not stop the other conditions
            yield Ended(job, printable(in_one_line(error, opened.config.root)), isinstance(error, StorageError))
        else:
            yield Ended(job, again=len(fetch.again.get(condition.id, ())))


def _named(line: LiveLine, job: Job) -> Callable[[RunProgress], None]:
    """Return a watcher that calls the condition as claims do; the task's own name may be another one's, too."""
    return lambda progress: line(replace(progress, condition=job.label))


def main() -> int:
    """Run what standard input asks for; 2 where the project cannot be opened."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the command that has started this process ends it
    orders, replies = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # what methods and tasks print is no reply
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)  # and no order is for programs that they start

    def reply(one: Reply) -> None:
        replies.write(msgspec.json.encode(one) + b"\n")

    order = msgspec.json.decode(orders.readline(), type=WorkOrder)
    try:
        opened = Opened.here(order.storage)
    except UserError as error:
        print(error, file=sys.stderr)
        return USER_ERROR
    asked: queue.SimpleQueue[Job] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(orders, asked), daemon=True).start()
    reply(Told())
    line = LiveLine(lambda text: reply(Told(text.strip())), None, log_seconds=TOLD_SECONDS)
    for ended in run_jobs(opened, order, iter(asked.get, None), line):
        reply(ended)
    return 0


def _read(orders: IO[bytes], asked: Any) -> None:
    """Pass conditions on as they are asked for, and end the process with its input.

    The command closes it when nothing is left to run, or has died: what runs then goes on from its checkpoint when it
    is asked for again.
    """
    for text in orders:
        asked.put(msgspec.json.decode(text, type=Job))
    os._exit(0)


if __name__ == "__main__":
    raise SystemExit(main())
