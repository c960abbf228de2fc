"""How long a method's step takes in a condition of the full tier, trials side by side: milliseconds, and a digest.

    python benchmarks/method_steps.py map_elites:stones neat:stones [--trials 10] [--from 3] [--to 23] [--device gpu]

To compare two commits, run it in both checkouts in turns. The digest is of all states after the last step: where it is
the same, so are all bits. Compilation, without a cache, is not part of the times. A trial that solves its task goes on.
"""

from __future__ import annotations

import argparse
import hashlib
import time
from dataclasses import replace
from typing import Any

from evoclaims.trials import devices

devices.configure()

import jax  # noqa: E402
import numpy as np  # noqa: E402

from evoclaims.trials.lanes import Lanes  # noqa: E402
from reproductions.nisioti2025 import REPRODUCTION  # noqa: E402


def digest(states: Any) -> str:
    """Return a digest of all numbers."""
    return hashlib.sha256(b"".join(np.asarray(leaf).tobytes() for leaf in jax.tree.leaves(states))).hexdigest()[:12]


def measure(name: str, options: argparse.Namespace, device: jax.Device) -> None:
    """Measure one condition and print it."""
    method, task = name.split(":")
    condition = REPRODUCTION.tiers["full"].conditions[method, task]
    lanes = Lanes(replace(condition, progression="whole_budget"), [device])
    begin, end, trials = options.first, options.last, options.trials
    states = lanes.start(range(trials), trials)
    lanes.programs(trials)
    states, _ = lanes.advance(states, begin, trials)
    leaves, structure = jax.tree.flatten(lanes.gather(states))
    start = [np.array(leaf) for leaf in leaves]  # Brax's counters stay on the device, where a round would delete them
    took = []
    for _ in range(options.rounds):
        states = jax.block_until_ready(lanes.place(jax.tree.unflatten(structure, start), trials))
        began = time.perf_counter()
        states, _ = lanes.advance(states, end, trials)
        jax.block_until_ready(states)
        took.append((time.perf_counter() - began) / (end - begin) * 1000)
    rounds = ", ".join(f"{milliseconds:.2f}" for milliseconds in took)
    print(f"{name}, {trials} trials, steps {begin + 1} to {end}, on {device.device_kind}: {rounds} ms a step")
    print(f"  digest {digest(lanes.gather(states))}, compiled in {lanes.seconds:.1f} s", flush=True)


def main() -> None:
    """Measure the conditions that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("conditions", nargs="+", metavar="METHOD:TASK")
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--from", dest="first", type=int, default=3, help="steps before those that are measured")
    parser.add_argument("--to", dest="last", type=int, default=23)
    parser.add_argument("--rounds", type=int, default=3, help="from the same states")
    parser.add_argument("--device", choices=devices.DEVICE_NAMES, default="auto")
    options = parser.parse_args()
    jax.config.update("jax_enable_compilation_cache", False)
    for name in options.conditions:
        measure(name, options, devices.choose(options.device)[0])


if __name__ == "__main__":
    main()
