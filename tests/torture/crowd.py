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
from tortured_project import REPORTS, TRIALS, walkers

LIFE = 20.0
"""Seconds after which a process is killed on average, its start included."""

PAUSE = 1.0
"""Seconds between two reports of a batch: a batch lasts longer than a process, so that several go on with it."""

SECONDS_BETWEEN_LOOKS = 5.0

KINDS = {"evoclaims run of one condition": 5, "pytest of four claims": 4, "pytest -m smoke of all claims": 1}
"""What a process does, and how often each is drawn."""

BLOWS = {signal.SIGKILL: 4, signal.SIGTERM: 1}
"""Ways to strike, and how often each is drawn."""


def attack(laboratory: Laboratory, times: int, draw: random.Random, life: float = LIFE, pause: float = PAUSE) -> Tally:
    """Let so many processes work on one store for the laboratory's seconds, with more to do than they can finish."""
    tally = Tally(f"{times} processes on one store for {laboratory.seconds:.0f} s")
    methods = max(times, round(times * laboratory.seconds / (REPORTS * pause)))
    workers = min(times, os.cpu_count() or 1)
    truth = laboratory.undisturbed(methods, workers)
    with laboratory.bench(pause, methods, lease=60.0) as bench:
        guard = Guard(bench, truth, tally)
        _Crowd(bench, guard, draw, times, life).work(laboratory.seconds)
        tally.done["trials finished under attack"] = len(bench.records())
        bench.pause = 0.0
        running = bench.pytest(workers)
        running.end()
        guard.judged(running)
        guard.plainly(running)
        guard.finish()
        _again(bench, tally)
        bench.kept = bool(tally.violations)
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
        return self._draw.expovariate(self._size / self._life)

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
        open_ones = [name for name in walkers(self._bench.walkers) if stored[name] < TRIALS][: self._size]
        if kind.startswith("evoclaims") and open_ones:
            return self._bench.evoclaims("run", self._draw.choice(open_ones))
        if "four" in kind and open_ones:
            names = self._draw.sample(open_ones, min(4, len(open_ones)))
            return self._bench.pytest(0, ["-k", " or ".join(names)])
        return self._bench.pytest(0, ["-m", "smoke"])


def _again(bench: Bench, tally: Tally) -> None:
    """Demand that nobody trains a condition on whose trials are all stored, but for the process that ends it."""
    stored: Counter[str] = Counter()
    enders: dict[str, int] = {}
    for line in bench.events():
        if line["what"] == "put":
            stored[line["condition"]] += 1
            enders[line["condition"]] = line["pid"]
        elif line["what"] == "training" and stored[line["condition"]] >= TRIALS:
            own = line["pid"] == enders[line["condition"]]
            tally.demand(own, f"condition {line['condition'][:8]} was trained on when all its trials were stored")
