"""A crowd of processes on one store, each killed after a while and started again, until the time is over."""

from __future__ import annotations

import os
import random
import signal
import time
from collections import Counter

from bench import Bench, Laboratory, Running
from guard import Guard
from tally import Tally
from tortured_project import REPORTS, TRIALS, methods

from evoclaims.trials.notice import FRESH_SECONDS

LIFE = 20.0
"""Seconds after which a process is killed on average, its start included."""

PAUSE = 1.0
"""Seconds between two reports of a batch: a batch lasts longer than a process, so that several go on with it."""

SECONDS_BETWEEN_LOOKS = 5.0

KINDS = {"evoclaims run of one condition": 5, "pytest of four claims": 4, "pytest -m smoke of all claims": 1}
"""What a process does, and how often each is drawn."""

BLOWS = {signal.SIGKILL: 4, signal.SIGTERM: 1}
"""Ways to strike, and how often each is drawn."""


def attack(
    laboratory: Laboratory,
    times: int,
    draw: random.Random,
    seconds: float | None = None,
    life: float = LIFE,
    pause: float = PAUSE,
) -> Tally:
    """Let so many processes work on one store, which has more to do than they can finish; then finish undisturbed."""
    seconds = laboratory.seconds if seconds is None else seconds
    tally = Tally(f"{times} processes on one store for {seconds:.0f} s")
    further = max(0, round(times * seconds / (REPORTS * pause)) - len(methods(0)))
    workers = min(further, os.cpu_count() or 1)
    truth = laboratory.undisturbed(further, workers) if further else laboratory.truth
    with laboratory.bench(pause, further, lease=FRESH_SECONDS) as bench:
        guard = Guard(bench, truth, tally)
        _Crowd(bench, guard, draw, times, life).work(seconds)
        tally.done["trials finished in the crowd"] = len(bench.records())
        bench.pause = 0.0
        running = bench.pytest(workers)
        running.end()
        guard.judged(running)
        guard.plainly(running)
        guard.finish()
        tally.done["trials finished"] = len(bench.records())
        tally.done["lost"] = len(guard.lost)
        tally.done["repeated"] = guard.repeated.total()
    return tally


class _Crowd:
    """Processes on a bench, of which each that ends is followed by another."""

    def __init__(self, bench: Bench, guard: Guard, draw: random.Random, size: int, life: float) -> None:
        self._bench, self._guard, self._draw, self._size, self._life = bench, guard, draw, size, life
        self._living: list[Running] = []
        self._struck: set[int] = set()

    def work(self, seconds: float) -> None:
        """Start, strike and look until the time is over; then kill all that still run."""
        now = time.monotonic()
        end, start, strike, look = now + seconds, now, now + self._interval(), now
        while (now := time.monotonic()) < end:
            self._collect()
            if len(self._living) < self._size and now >= start:
                self._living.append(self._started())
                start = now + min(0.2, self._life / self._size)  # staggered, so that they are in different phases
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
        return self._draw.uniform(0.5, 1.5) * self._life / self._size

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
        (kind,) = self._draw.choices([*KINDS], [*KINDS.values()])
        self._guard.tally.done["processes started"] += 1
        stored = Counter(line["name"] for line in self._bench.events() if line["what"] == "put")
        open_ones = [name for name in methods(self._bench.further) if stored[name] < TRIALS][: self._size]
        if kind.startswith("evoclaims") and open_ones:
            return self._bench.evoclaims("run", self._draw.choice(open_ones))
        if "four" in kind and open_ones:
            names = self._draw.sample(open_ones, min(4, len(open_ones)))
            return self._bench.pytest(0, ["-k", " or ".join(names)])
        return self._bench.pytest(0, ["-m", "smoke"])
