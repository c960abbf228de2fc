"""Breeding by kernels against the same functions in jax: to the bit, in its parts and in a whole evolution."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from assembler import assemble, kernels_for_gpus
from genomes import CONNECTIONS, NODES, dags, made, same, stacked
from hypothesis import given, settings
from hypothesis import strategies as st
from without_kernels import BREEDING, without_kernels

from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.neat.neat import Neat
from evoclaims.methods.neat.settings import Attribute, Mutation, Settings, Species
from evoclaims.methods.neat.structure import descendants, packed
from evoclaims.networks.genome import Genome


def _both_ways(function: Callable[..., Any]) -> tuple[Any, Any]:
    """Return a function compiled with the kernels of breeding, and one without."""

    def without(*arguments: Any) -> Any:
        with without_kernels(BREEDING):
            return function(*arguments)

    return jax.jit(function), jax.jit(without)


def _kept(genomes: Genome, kept: Any, counts: Any) -> Any:
    return jax.tree.map(
        lambda leaf: jax.lax.bitcast_convert_type(leaf, jnp.int32), jax.vmap(packed)(genomes.connections, kept, counts)
    )


DESCENDANTS, PACKED = _both_ways(jax.vmap(descendants)), _both_ways(_kept)
NUMBERS = st.integers(0, 2**31)


@settings(max_examples=40, deadline=None)
@given(st.lists(dags(), min_size=1, max_size=3), NUMBERS)
def test_parts_of_structural_mutation_are_the_same_to_the_bit(genomes: list[Genome], seed: int) -> None:
    """Of genomes without connections and full ones; NaN among the weights is moved as it is."""
    draw, count = np.random.default_rng(seed), len(genomes)
    population = stacked(genomes)
    starts = draw.integers(0, population.node_count).astype(np.int32)
    happens = draw.random(count) < 0.7
    linked = np.where(happens, population.connection_count, 0).astype(np.int32)
    by_kernel, without = (np.asarray(each(population, starts, linked)) for each in DESCENDANTS)
    np.testing.assert_array_equal(by_kernel, without)
    strange = population.connections.weight.view(np.uint32)
    strange[draw.random(strange.shape) < 0.2] = 0x7FC12345
    kept = draw.random((count, CONNECTIONS)) < draw.random((count, 1)) * 1.2
    counts = np.where(happens, draw.integers(0, CONNECTIONS + 1, count), 0).astype(np.int32)
    assert same(*(each(population, kept, counts) for each in PACKED))


def test_nvidias_assembler_takes_the_kernels(tmp_path: Path) -> None:
    genomes = stacked([made([0, 1, 2], {(0, 2): 1.0})] * 3)
    none = np.zeros(3, np.int32)
    texts = [
        *kernels_for_gpus(jax.vmap(descendants), genomes, none, none),
        *kernels_for_gpus(jax.vmap(packed), genomes.connections, np.zeros((3, CONNECTIONS), bool), none),
    ]
    assert len(texts) == 2
    for text in texts:
        assemble(text, tmp_path)


@pytest.mark.parametrize(
    "most_nodes", [pytest.param(NODES, marks=pytest.mark.oldest), pytest.param(40, marks=pytest.mark.slow)]
)
def test_thirty_generations_are_the_same_to_the_bit(most_nodes: int) -> None:
    """Of genomes that reach the limits of their arrays, in several species; two trials at once."""
    task = NParity(3)
    chosen = Settings(
        population=24,
        nodes=most_nodes,
        connections=3 * most_nodes,
        mutation=Mutation(node_add=0.7, connection_add=0.7, weight=Attribute(mutate_rate=0.5)),
        species=Species(most=5, threshold=1.5, exempt=1, survival=0.4),
    )

    method = Neat(chosen)

    def evolution(key: Any) -> Any:
        def generation(state: Any, key: Any) -> Any:
            state, progress = method.step(key, task, jnp.zeros((), jnp.int32), state)
            return state, (progress, state.population.species.count)

        first, rest = jax.random.split(key)
        return jax.lax.scan(generation, method.init(first, task), jax.random.split(rest, 30))

    by_kernels, without = (
        jax.device_get(each(jax.random.split(jax.random.key(5), 2))) for each in _both_ways(jax.vmap(evolution))
    )
    assert same(by_kernels, without)
    (state, (_, species)) = by_kernels
    assert (state.population.genomes.node_count.max(axis=1) >= NODES).all()
    assert (species.max(axis=1) > 1).all()
