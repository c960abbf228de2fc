"""Several worker processes that run conditions of one store; one that dies takes no other condition with it."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import replace

import msgspec

from evoclaims.cli.worker import USER_ERROR, Order
from evoclaims.core.errors import UserError
from evoclaims.mutants.conditions import Job
from evoclaims.report.live_line import duration
from evoclaims.trials.devices import usable_cores


def processes_of(text: str) -> int:
    """Return the number of processes that an option asks for: a number, or "auto" for one per usable core.

    Raises:
        UserError: for anything else.
    """
    if text == "auto":
        return usable_cores()
    if not text.isdecimal() or int(text) < 1:
        raise UserError(f"--numprocesses takes a number from 1 up, or auto (one for each core), not {text!r}.")
    return int(text)


def bundled(groups: Iterable[tuple[Sequence[Job], float]], processes: int) -> list[tuple[list[Job], float]]:
    """Join groups of conditions, the longest first, until each bundle is worth the start of a process.

    A process takes seconds to start; a bundle is about an eighth of what each of `processes` has to do, so that they
    end at about the same time.
    """
    longest_first = sorted(groups, key=lambda group: -group[1])
    enough = sum(seconds for _, seconds in longest_first) / (8 * processes)
    bundles: list[tuple[list[Job], float]] = []
    for group, seconds in longest_first:
        if bundles and bundles[-1][1] < enough:
            bundles[-1] = ([*bundles[-1][0], *group], bundles[-1][1] + seconds)
        else:
            bundles.append((list(group), seconds))
    return bundles


class Workers:
    """Starts a process for each bundle of conditions, several at a time."""

    def __init__(self, order: Order, processes: int, lacks: Callable[[Job], bool]) -> None:
        """Start nothing yet.

        Args:
            order: store, tier and device; its conditions are replaced by each group.
            processes: how many run at a time.
            lacks: whether the store lacks trials of a condition.
        """
        self._order = order
        self._processes = processes
        self._lacks = lacks
        self._running: set[subprocess.Popen[bytes]] = set()
        self._stopping = threading.Event()

    def run(self, groups: Iterable[tuple[Sequence[Job], float]]) -> None:
        """Run groups of conditions, the longest first, and print a line whenever a process has ended.

        Args:
            groups: conditions that one process must run one after the other, and about how many seconds they take.
        """
        bundles = bundled(groups, self._processes)
        total, done, ended = sum(seconds for _, seconds in bundles), 0.0, 0
        conditions, began = sum(len(bundle) for bundle, _ in bundles), time.monotonic()
        with ThreadPoolExecutor(self._processes) as pool:
            try:
                calls = {pool.submit(self._run, bundle): (bundle, seconds) for bundle, seconds in bundles}
                for call in as_completed(calls):
                    call.result()
                    bundle, seconds = calls[call]
                    done, ended = done + seconds, ended + len(bundle)
                    left = (time.monotonic() - began) * (total - done) / done
                    print(
                        f"  {ended} of {conditions} conditions have ended, {duration(left)} left: {bundle[-1].label}",
                        flush=True,
                    )
            except BaseException:
                self._stop()
                pool.shutdown(cancel_futures=True)
                raise

    def _run(self, bundle: Sequence[Job]) -> None:
        """Run a bundle; where the process dies, another one goes on behind the condition that it died of."""
        left = list(bundle)
        while left and not self._stopping.is_set():
            status, said = self._process(left)
            print(said, file=sys.stderr, end="", flush=True)
            if self._stopping.is_set() or status in (0, USER_ERROR):
                return
            lacking = [one for one in left if self._lacks(one)]
            if lacking:
                print(f"evoclaims: {lacking[0].label} failed: its process died (status {status}).", file=sys.stderr)
            left = lacking[1:]

    def _process(self, group: Sequence[Job]) -> tuple[int, str]:
        """Run a process to its end; return its status and what it wrote to standard error."""
        command = [sys.executable, "-m", "evoclaims.cli.worker"]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        ) as process:
            self._running.add(process)
            _, said = process.communicate(msgspec.json.encode(replace(self._order, conditions=tuple(group))))
            self._running.discard(process)
        return process.returncode, said.decode(errors="replace")

    def _stop(self) -> None:
        """End all processes: what they have stored stays, and checkpoints let another call go on."""
        self._stopping.set()
        for process in list(self._running):
            process.terminate()
