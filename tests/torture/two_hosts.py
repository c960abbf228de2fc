"""Two machines on one folder: two process trees with host names of their own, of which one dies or hangs."""

from __future__ import annotations

import random
import signal
import time

from bench import Laboratory, hosts_are_real
from guard import Guard
from tally import Tally

ENDS = ("dies", "hangs", "lives")


def attack(laboratory: Laboratory, times: int, draw: random.Random) -> Tally:
    """Share a store between two hosts so many times, each of which runs `pytest -n 2`."""
    tally = Tally("two hosts on one store")
    if not hosts_are_real():
        tally.notes.append("this system lets no process have a host name of its own, so that it is patched in Python")
    for number in range(times):
        end = ENDS[number % len(ENDS)]
        with laboratory.bench(pause=0.12) as bench:
            guard = Guard(bench, laboratory.truth, tally, once=end != "hangs")
            alpha = bench.pytest(host="alpha")
            with bench.held(alpha):
                bench.until_said("training", alpha)
                beta = bench.pytest(host="beta")
                bench.until_said("waiting", beta, times=3)
            hosts = {line["host"] for line in bench.events()}
            tally.demand(hosts == {"alpha", "beta"}, f"the hosts are {hosts}")
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
                running.end()
                guard.judged(running)
                guard.plainly(running)
            guard.finish()
    return tally
