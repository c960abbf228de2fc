"""kill -9 and SIGTERM in the middle of trials under `pytest -n 2`: of a worker, of the controller, of all at once."""

from __future__ import annotations

import os
import random
import signal
import time
from contextlib import suppress

from bench import Bench, Laboratory, Running, is_alive, until
from guard import Guard
from tally import Tally

BLOWS = {"kill -9 of a worker": 6, "kill -9 of a whole run": 1, "SIGTERM of a controller": 1, "SIGTERM of a worker": 2}
"""Ways to strike, and how often each is drawn."""


def attack(laboratory: Laboratory, times: int, draw: random.Random) -> Tally:
    """Strike so many times, on as many stores as it takes; each store comes to its end."""
    tally = Tally("processes killed under pytest -n 2")
    blows = [*BLOWS][:times] + draw.choices([*BLOWS], [*BLOWS.values()], k=max(times - len(BLOWS), 0))
    draw.shuffle(blows)
    while blows:
        with laboratory.bench() as bench:
            guard = Guard(bench, laboratory.truth, tally)
            running = _struck(bench, blows, draw, guard)
            guard.judged(running)
            guard.finish()
            tally.done["stores"] += 1
    return tally


def _struck(bench: Bench, blows: list[str], draw: random.Random, guard: Guard) -> Running:
    """Run pytest, strike, and begin again until a run has come to its end unharmed; return that one."""
    while True:
        running, harmed = bench.pytest(workers=2 if blows else 0), False
        while blows and (worker := _training(bench, running)) is not None:
            time.sleep(draw.uniform(0.0, 0.5))
            if not is_alive(worker):
                continue
            blow, harmed = blows.pop(), True
            guard.tally.done[blow] += 1
            if _strike(blow, running, worker):
                break  # and begin at once, beside workers that may not have noticed yet
            guard.look()
        else:
            running.end()
        guard.look()
        if not harmed and running.process.poll() is not None:
            return running


def _training(bench: Bench, running: Running) -> int | None:
    """Wait until a worker has said from now on that it trains; None when the run has ended."""
    since = len(bench.events())

    def found() -> list[int]:
        lines = bench.said("training", running, since)
        return [lines[-1]["pid"]] if lines else [0] if running.process.poll() is not None else []

    (pid,) = until(found, "a worker that trains, or the end of a run")
    return pid or None


def _strike(blow: str, running: Running, worker: int) -> bool:
    """Strike; return whether the run is over."""
    number = signal.SIGTERM if "SIGTERM" in blow else signal.SIGKILL
    if "whole run" in blow:
        running.signal(number)
        running.end()
        return True
    target = running.pid if "controller" in blow else worker
    with suppress(ProcessLookupError):
        os.kill(target, number)
    if target == running.pid:
        running.end()
        return True
    until(lambda: not is_alive(worker), "the death of a worker")
    return False
