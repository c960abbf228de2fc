"""SIGSTOP and SIGCONT: a process stopped in the middle, and another that waits for it and then takes over."""

from __future__ import annotations

import random
import signal
import time

from bench import LEASE, Bench, Laboratory, Running
from guard import Guard
from tally import Tally

FIRST = ["stop a", "b waits", "continue a", "a trains", "stop a", "wait long", "b trains", "continue a", "a trains"]
"""A short stop keeps the other waiting and repeats nothing; after a long one the other takes over beside it."""


def attack(laboratory: Laboratory, times: int, draw: random.Random) -> Tally:
    """Stop and continue two processes so many times, first in a fixed order and then as it comes."""
    tally = Tally("processes stopped and continued")
    for number in range(times):
        with laboratory.bench(pause=0.12) as bench:
            guard = Guard(bench, laboratory.truth, tally, once=False)
            runs = {"a": _start(bench)}
            bench.until_said("training", runs["a"])
            runs["b"] = _start(bench)
            for step in _drawn(draw) if number else FIRST:
                _take(step, bench, runs, draw, tally)
                guard.look()
            for name, running in runs.items():
                running.signal(signal.SIGCONT)
                tally.demand(running.end() == 0, f"{name} ended with status {running.process.returncode}")
                guard.plainly(running, "quick on parity")
            guard.finish()
            left = [path.name for folder in ("running", "checkpoints") for path in (bench.store / folder).glob("*")]
            tally.demand(not left, f"these were left behind: {left}")
    return tally


def _start(bench: Bench) -> Running:
    return bench.evoclaims("run")


def _drawn(draw: random.Random) -> list[str]:
    """Return steps in which both may be stopped at once, and some stops are long."""
    steps = ["stop a", "stop b", "continue a", "continue b", "wait long", "wait"]
    return draw.choices(steps, [4, 4, 3, 3, 3, 3], k=14)


def _take(step: str, bench: Bench, runs: dict[str, Running], draw: random.Random, tally: Tally) -> None:
    """Take one step, unless the process that it is about has ended."""
    words = step.split()
    if step == "wait long":
        time.sleep(1.5 * LEASE)
    elif step == "wait":
        time.sleep(draw.uniform(0.0, 1.0))
    elif words[0] == "stop":
        tally.done["stops"] += 1
        runs[words[1]].signal(signal.SIGSTOP)
    elif words[0] == "continue":
        runs[words[1]].signal(signal.SIGCONT)
    else:
        bench.until_said({"waits": "waiting", "trains": "training"}[words[1]], runs[words[0]], times=2)
