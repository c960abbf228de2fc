"""NEAT's kernels and the same without them in turns, in CPU time of this process.

    python benchmarks/neat_kernels.py [--rounds 5]

Forward pass: full: 256 genomes of 100 nodes and 183 connections, 64 rows each; one: the same with a row each; young:
1,024 genomes of the first generation, in arrays of 32 nodes. Without kernels it is the pass by matrices. Both are given
genomes, so that sorting connections and filling matrices are part of the times.

Breeding: crossover, species, structure, values: parts of the breeding of the full genomes; generation: a whole one of
theirs, on 6-parity, with the forward pass's kernel both ways. Both ways must give the same bits.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any
from unittest.mock import patch

import jax
import jax.numpy as jnp
from neat_against_tensorneat import TASK, random_genomes, sized, with_ours

from evoclaims.kernels.call.grouped import GroupKernel
from evoclaims.kernels.call.random_bits import kernel_prng
from evoclaims.methods.neat.evolution import Neat
from evoclaims.methods.neat.homology import crossover
from evoclaims.methods.neat.mutation import mutate_structure, mutate_values
from evoclaims.methods.neat.population import first_population
from evoclaims.methods.neat.species import one_species, speciate
from evoclaims.networks.genome import Genome, resized
from evoclaims.networks.graph import GraphNetwork

NETWORK = GraphNetwork(TASK.observation_size, TASK.action_size)
ROWS = jnp.asarray(TASK.table.inputs)
BREEDING = "The breeding of genomes", "The making of random keys"


def by_kernel(genome: Genome, rows: Any) -> Any:
    """Return a genome's answers."""
    return jax.vmap(partial(NETWORK.apply, NETWORK.express(genome)))(rows)


def by_matrices(genome: Genome, rows: Any) -> Any:
    """Return the same as machines without the kernel compute it."""
    return jax.vmap(partial(NETWORK.propagate, NETWORK.matrices(NETWORK.express(genome))))(rows)


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


@contextmanager
def without_kernels(names: Sequence[str]) -> Iterator[None]:
    """Let the kernels of these names be what machines without them compute, in functions that are traced meanwhile."""
    with patch.object(GroupKernel, "supported", property(lambda kernel: kernel.name not in names)):
        yield


def parts_of_breeding(genomes: Genome) -> dict[str, tuple[Any, ...]]:
    """Return the parts, each a function and its arguments."""
    size = genomes.node_count.shape[0]
    settings = sized(size)
    keys = jax.random.split(jax.random.key(1), size)
    others = jax.tree.map(lambda leaf: jnp.roll(leaf, 1, axis=0), genomes)
    new_keys = 1_000 + jnp.arange(size, dtype=jnp.int32)
    grouped = jax.jit(partial(speciate, settings.species))(one_species(settings.species, genomes), genomes, 1)
    method, level = Neat(settings), jnp.zeros((), jnp.int32)
    first = with_ours(settings, genomes, method.init(keys[0], TASK))
    state = replace(first, population=replace(first.population, species=grouped))

    def structure(key: Any, genome: Genome, new_key: Any) -> Genome:
        return mutate_structure(kernel_prng(key), settings.mutation, genome, new_key, NETWORK.inputs, NETWORK.outputs)

    return {
        "crossover": (jax.vmap(lambda key, *parents: crossover(kernel_prng(key), *parents)), keys, genomes, others),
        "species": (partial(speciate, settings.species), grouped, genomes, 1),
        "structure": (jax.vmap(structure), keys, genomes, new_keys),
        "values": (
            jax.vmap(lambda key, genome: mutate_values(kernel_prng(key), settings.mutation, 1, genome)),
            keys,
            genomes,
        ),
        "generation": (lambda key, state: method.step(kernel_prng(key), TASK, level, state), keys[0], state),
    }


def in_turns(name: str, rounds: int, passes: list[Any], *arguments: Any) -> None:
    """Measure both ways, that with kernels first, and print it."""
    turns = [[cpu_ms(each, *arguments) for each in passes] for _ in range(rounds)]
    kernel, without = map(min, zip(*turns, strict=True))
    print(f"{name}: kernel {kernel:.2f} ms, without {without:.2f} ms, ratio {without / kernel:.1f}", flush=True)


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
        in_turns(name, rounds, passes, genomes, rows)
    for name, (function, *arguments) in parts_of_breeding(full).items():
        kernels = jax.jit(function).lower(*arguments).compile()
        with without_kernels(BREEDING):
            passes = [kernels, jax.jit(lambda *given, function=function: function(*given)).lower(*arguments).compile()]
        results = [jax.device_get(jax.tree.leaves(each(*arguments))) for each in passes]
        if any(a.tobytes() != b.tobytes() for a, b in zip(*results, strict=True)):
            raise SystemExit(f"The kernels of {name} give other bits.")
        in_turns(name, rounds, passes, *arguments)


if __name__ == "__main__":
    main()
