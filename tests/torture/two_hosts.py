"""Two machines on one folder: two process trees with host names of their own, of which one dies or hangs."""

from __future__ import annotations

import random
import signal
import time

from bench import Bench, Laboratory, Running, hosts_are_real
from guard import Guard
from tally import Tally

ENDS = ("dies", "hangs", "lives")


def attack(laboratory: Laboratory, times: int, draw: random.Random, trees: bool = True) -> Tally:
    """Share a store between two hosts so many times; with `trees`, each of them runs `pytest -n 2`."""
    tally = Tally("two hosts on one store")
    if not hosts_are_real():
        tally.notes.append("this system lets no process have a host name of its own, so that it is patched in Python")
    for number in range(times):
        end = ENDS[number % len(ENDS)]
        with laboratory.bench(pause=0.12) as bench:
            guard = Guard(bench, laboratory.truth, tally, once=end != "hangs")
            alpha = _start(bench, "alpha", trees)
            with bench.held(alpha):
                bench.until_said("training", alpha)
                beta = _start(bench, "beta", trees)
                bench.until_said("waiting", beta, times=3)
            tally.demand(_hosts(bench) == {"alpha", "beta"}, f"the hosts are {_hosts(bench)}")
            tally.done[f"stores of which one host {end}"] += 1
            time.sleep(draw.uniform(0.0, 1.0))
            if end == "dies":
                alpha.signal(signal.SIGKILL)
            elif end == "hangs":
                alpha.signal(signal.SIGSTOP)
            guard.look()
            if end != "lives":
                bench.until_said("training", beta, times=3)
                alpha.signal(signal.SIGCONT)
            for running in (beta,) if end == "dies" else (beta, alpha):
                _ended(running, guard, trees)
            guard.finish()
    return tally


def _start(bench: Bench, host: str, trees: bool) -> Running:
    return bench.pytest(host=host) if trees else bench.evoclaims("run", host=host)


def _hosts(bench: Bench) -> set[str]:
    return {line["host"] for line in bench.events()}


def _ended(running: Running, guard: Guard, trees: bool) -> None:
    """Wait for a run's end, and compare what it judges."""
    status = running.end()
    if trees:
        guard.judged(running)
    else:
        guard.tally.demand(status == 0, f"it ended with status {status}")
    guard.plainly(running)
