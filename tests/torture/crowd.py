"""A crowd of processes on one store, each killed after a while and started again, until the time is over."""

from __future__ import annotations

import os
import random
import signal
import time
from collections import Counter
from collections.abc import Sequence

from bench import Bench, Laboratory, Running, until
from guard import Guard
from tally import Tally
from tortured_project import REPORTS, TRIALS, methods

from evoclaims.trials.lease import FRESH_SECONDS

LIFE = 20.0
"""Seconds after which a process is killed on average, its start included."""

PAUSE = 1.0
"""Seconds between two reports of a batch: a batch lasts longer than a process, so that several go on with it."""

STAGGER = 0.2
"""Seconds between two starts, so that processes are in different phases; but no process is missing for long."""

SECONDS_BETWEEN_LOOKS = 5.0

BLOWS = {signal.SIGKILL: 4, signal.SIGTERM: 1}
"""Ways to strike, and how often each is drawn."""


def attack(laboratory: Laboratory, times: int, draw: random.Random) -> Tally:
    """Let so many processes work on one store, which has more to do than they can finish; then finish undisturbed."""
    seconds = laboratory.seconds
    tally = Tally(f"{times} processes on one store for {seconds:.0f} s")
    further = max(0, round(times * seconds / (REPORTS * PAUSE)) - len(methods(0)))
    workers = min(further, os.cpu_count() or 1)
    truth = laboratory.undisturbed(further, workers) if further else laboratory.truth
    with laboratory.bench(PAUSE, further, lease=FRESH_SECONDS) as bench:
        guard = Guard(bench, truth, tally)
        _Crowd(bench, guard, draw, times).work(seconds)
        tally.done["trials finished in the crowd"] = len(bench.records())
        bench.pause = 0.0
        running = bench.pytest(workers)
        running.end()
        guard.judged(running)
        guard.plainly(running)
        guard.finish()
    return tally


def _run_one(bench: Bench, names: Sequence[str], draw: random.Random) -> Running:
    return bench.evoclaims("run", draw.choice(names))


def _judge_some(bench: Bench, names: Sequence[str], draw: random.Random) -> Running:
    return bench.pytest(0, ["-k", " or ".join(draw.sample(names, min(4, len(names))))])


def _judge_all(bench: Bench, names: Sequence[str], draw: random.Random) -> Running:
    return bench.pytest(0, ["-m", "smoke"])


STARTS = {_run_one: 5, _judge_some: 4, _judge_all: 1}
"""What a process does, given what is unfinished, and how often each is drawn."""


class _Crowd:
    """Processes on a bench, of which each that ends is followed by another."""

    def __init__(self, bench: Bench, guard: Guard, draw: random.Random, size: int) -> None:
        self._bench, self._guard, self._draw, self._size = bench, guard, draw, size
        self._living: list[Running] = []
        self._struck: set[int] = set()
        self._next_start = 0.0

    def work(self, seconds: float) -> None:
        """Start, strike and look for so long from the first report on; then kill all that still run."""
        until(self._filled, "the first report of a crowd")
        now = time.monotonic()
        end, strike, look = now + seconds, now + self._interval(), now
        while (now := time.monotonic()) < end:
            self._filled()
            if self._living and now >= strike:
                self._strike()
                strike = now + self._interval()
            if now >= look:
                self._guard.look()
                look = now + SECONDS_BETWEEN_LOOKS
            time.sleep(0.02)
        for running in self._living:
            self._guard.tally.done["kill -9 at the end"] += running.process.poll() is None
            running.signal(signal.SIGKILL)
            running.end()
        self._guard.look()

    def _interval(self) -> float:
        return self._draw.uniform(0.5, 1.5) * LIFE / self._size

    def _filled(self) -> bool:
        """Start a process if one is lacking, and return whether any has ever reported."""
        self._collect()
        if len(self._living) < self._size and time.monotonic() >= self._next_start:
            self._living.append(self._started())
            self._next_start = time.monotonic() + min(STAGGER, LIFE / self._size)
        return bool(self._bench.events())

    def _collect(self) -> None:
        """Forget what has ended; what nobody has struck must have ended well."""
        for running in [running for running in self._living if running.process.poll() is not None]:
            self._living.remove(running)
            if running.pid not in self._struck:
                self._guard.tally.done["processes that came to their end"] += 1
                self._guard.plainly(running)

    def _strike(self) -> None:
        running = self._draw.choice(self._living)
        (blow,) = self._draw.choices([*BLOWS], [*BLOWS.values()])
        self._struck.add(running.pid)
        self._guard.tally.done["kill -9" if blow == signal.SIGKILL else "SIGTERM"] += 1
        running.signal(blow)

    def _started(self) -> Running:
        """Start a process on what is not finished yet; there are as many such conditions in sight as processes."""
        self._guard.tally.done["processes started"] += 1
        stored = Counter(line["name"] for line in self._bench.events() if line["what"] == "put")
        names = methods(self._bench.further)
        names = [name for name in names if stored[name] < TRIALS][: self._size] or names
        (start,) = self._draw.choices([*STARTS], [*STARTS.values()])
        return start(self._bench, names, self._draw)
