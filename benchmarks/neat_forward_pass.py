"""The forward pass of NEAT's genomes: the kernel and the pass by matrices in turns, in CPU time of this process.

    python benchmarks/neat_forward_pass.py [--rounds 5]

full: 256 genomes of 100 nodes and 183 connections, 64 rows each; one: the same with a row each; young: 1,024 genomes of
the first generation, in arrays of 32 nodes. Both passes are given genomes, so that sorting connections and filling
matrices are part of the times.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from neat_against_tensorneat import TASK, random_genomes, sized

from evoclaims.methods.neat.population import first_population
from evoclaims.networks.genome import Genome, resized
from evoclaims.networks.graph import GraphNetwork

NETWORK = GraphNetwork(TASK.observation_size, TASK.action_size)
ROWS = jnp.asarray(TASK.table.inputs)


def by_kernel(genome: Genome, rows: Any) -> Any:
    """Return a genome's answers."""
    return jax.vmap(partial(NETWORK.apply, NETWORK.express(genome)))(rows)


def by_matrices(genome: Genome, rows: Any) -> Any:
    """Return the same as machines without the kernel compute it."""
    return NETWORK.apply_rows(NETWORK.matrices(NETWORK.express(genome)), rows)


def cpu_ms(function: Callable[..., Any], *arguments: Any) -> float:
    """Return CPU milliseconds of a call, from half a second of calls."""
    calls, began, before = 0, time.perf_counter(), _cpu()
    while time.perf_counter() - began < 0.5:
        jax.block_until_ready(function(*arguments))
        calls += 1
    return 1e3 * (_cpu() - before) / calls


def _cpu() -> float:
    """Return the CPU seconds of this process."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Measure all cases."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    full = random_genomes(sized(256))
    young = resized(first_population(jax.random.key(0), sized(1_024), NETWORK.inputs, NETWORK.outputs).genomes, 32, 96)
    for name, genomes, rows in (("full", full, ROWS), ("young", young, ROWS), ("one", full, ROWS[5:6])):
        passes = [jax.jit(jax.vmap(each, (0, None))) for each in (by_kernel, by_matrices)]
        for each in passes:
            jax.block_until_ready(each(genomes, rows))
        turns = [[cpu_ms(each, genomes, rows) for each in passes] for _ in range(rounds)]
        kernel, matrices = map(min, zip(*turns, strict=True))
        print(f"{name}: kernel {kernel:.2f} ms, matrices {matrices:.2f} ms, ratio {matrices / kernel:.0f}", flush=True)


if __name__ == "__main__":
    main()
