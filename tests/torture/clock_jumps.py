"""A clock that jumps by hours, forward and back, between two beats of a process that another waits for."""

from __future__ import annotations

import random
import time
from pathlib import Path

from bench import Laboratory
from guard import Guard
from tally import Tally

HOURS = 3600.0


def attack(laboratory: Laboratory, times: int, draw: random.Random) -> Tally:
    """Let clocks jump while two processes share a store, on two hosts and on one."""
    tally = Tally("clocks that jump")
    for number in range(times):
        hosts = ("alpha", "beta") if number % 2 == 0 else ("alpha", "alpha")
        with laboratory.bench(pause=0.12) as bench:
            guard = Guard(bench, laboratory.truth, tally)
            clocks = [bench.folder / f"clock-{name}" for name in "ab"]
            for clock in clocks:
                _set(clock, 0.0)
            runs = [bench.evoclaims("run", host=hosts[0], clock=clocks[0])]
            with bench.held(runs[0]):
                bench.until_said("training", runs[0])
                runs.append(bench.evoclaims("run", host=hosts[1], clock=clocks[1]))
                bench.until_said("waiting", runs[1], times=2)
                _set(clocks[1], draw.choice((-3.0, 3.0)) * HOURS)
                bench.until_said("waiting", runs[1], times=3)
            for _ in range(3):
                time.sleep(draw.uniform(0.0, 0.5))
                _set(draw.choice(clocks), draw.uniform(-9.0, 9.0) * HOURS)
            tally.done["jumps"] += 4
            guard.look()
            for running in runs:
                tally.demand(running.end() == 0, f"it ended with status {running.process.returncode}")
                guard.plainly(running, "quick on parity")
            guard.finish()
    return tally


def _set(clock: Path, seconds: float) -> None:
    """Say by how much a clock is wrong, in one step."""
    aside = clock.with_suffix(".aside")
    aside.write_text(str(seconds))
    aside.replace(clock)
