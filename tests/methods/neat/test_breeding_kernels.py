"""Breeding by kernels against the same functions in jax: to the bit, in its parts and in a whole evolution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from assembler import assemble, kernels_for_gpus
from block_machine import run
from genomes import CONNECTIONS, NODES, dags, made, same, stacked
from hypothesis import given, settings
from hypothesis import strategies as st
from usual_fusions import USUAL_FUSIONS
from without_kernels import BREEDING, without_kernels

from evoclaims.kernels.emit import group_kernel
from evoclaims.kernels.emit.gpu_kernel import GpuProgram
from evoclaims.methods.neat.mutation import _ordering, _removal, order_for, without_node
from evoclaims.methods.neat.population import first_population, next_population
from evoclaims.methods.neat.settings import Attribute, Mutation, Settings, Species
from evoclaims.networks.genome import Genome


def _both_ways(function: Callable[..., Any]) -> tuple[Any, ...]:
    """Return a function compiled with the kernels of breeding, and one without."""

    def without(*arguments: Any) -> Any:
        with without_kernels(BREEDING):
            return function(*arguments)

    return tuple(jax.jit(each, compiler_options=USUAL_FUSIONS) for each in (function, without))


def _changes(happens: Any, u: Any, v: Any, genome: Genome) -> Any:
    """Return the order for a link, and what is left without a node; weights as bits."""
    slot, connections, left = without_node(happens, u, genome, VISIBLE)
    bits = replace(connections, weight=jax.lax.bitcast_convert_type(connections.weight, jnp.int32))
    return order_for(happens, u, v, genome), slot, bits, left


VISIBLE = 4
INPUTS, OUTPUTS = 3, 1
CHANGES = _both_ways(jax.vmap(_changes))
NUMBERS = st.integers(0, 2**31)


def _drawn(genomes: list[Genome], seed: int) -> tuple[Any, Any, Any, Genome]:
    """Return what happens to genomes, two numbers of each, and the genomes, some of their weights NaN."""
    draw, population = np.random.default_rng(seed), stacked(genomes)
    u, v = (draw.integers(0, population.node_count).astype(np.int32) for _ in "uv")
    strange = population.connections.weight.copy()
    strange.view(np.uint32)[draw.random(strange.shape) < 0.2] = 0x7FC12345
    odd = replace(population, connections=replace(population.connections, weight=strange))
    return draw.random(len(genomes)) < 0.7, u, v, odd


@settings(max_examples=60, deadline=None)
@given(st.lists(dags(), min_size=1, max_size=3), NUMBERS)
def test_parts_of_structural_mutation_are_the_same_to_the_bit(genomes: list[Genome], seed: int) -> None:
    """Of genomes without connections and full ones; NaN among the weights is moved as it is."""
    given_ = _drawn(genomes, seed)
    assert same(*(each(*given_) for each in CHANGES))


@settings(max_examples=20, deadline=None)
@given(st.lists(dags(), min_size=3, max_size=3), NUMBERS)
def test_a_gpus_threads_change_what_the_processor_does_and_nothing_of_genomes_they_pass_over(
    genomes: list[Genome], seed: int
) -> None:
    """The machine fills arrays with 77 beforehand."""
    happens, u, v, population = _drawn(genomes, seed)
    order, slot, moved, left = CHANGES[1](happens, u, v, population)
    counts = np.where(happens, population.connection_count, -1).astype(np.int32)
    genes = population.connections
    cycle, *order_made = _on_gpu(_ordering(NODES, CONNECTIONS), genes.source, genes.target, counts, u, v)
    leaves = population.nodes.key, *jax.tree.leaves(genes), counts, u
    slot_made, left_made, *moved_made = _on_gpu(_removal(NODES, CONNECTIONS, VISIBLE), *leaves)
    np.testing.assert_array_equal(cycle, order[0])
    np.testing.assert_array_equal(slot_made, slot)
    np.testing.assert_array_equal(left_made, left)
    slots, places = np.arange(NODES), np.arange(CONNECTIONS)
    between = happens[:, None] & (slots >= v[:, None]) & (slots <= u[:, None])
    for made_, wanted in zip(order_made, order[1:], strict=True):
        np.testing.assert_array_equal(made_, np.where(between, wanted, 77))
    for made_, wanted in zip(moved_made, jax.tree.leaves(moved), strict=True):
        bits, kept = made_.view(np.int32), places < np.asarray(left)[:, None]
        np.testing.assert_array_equal(bits[kept], np.asarray(wanted)[kept])
        assert (made_[~happens] == 77).all()


def _on_gpu(kernel: Any, *leaves: Any) -> Any:
    """Return the results of a GPU's text, run on this processor, a thread for each genome."""
    count = len(leaves[0])
    text = group_kernel.gpu_text(kernel.write, kernel.sizes, count, 1, [])
    results = [jax.ShapeDtypeStruct((count, *out.shape), out.dtype) for out in kernel.outputs]
    return run(text, GpuProgram("", kernel.name), count, leaves, results)


def test_nvidias_assembler_takes_the_kernels(tmp_path: Path) -> None:
    genomes = stacked([made([0, 1, 2], {(0, 2): 1.0})] * 3)
    none = np.zeros(3, np.int32)
    texts = kernels_for_gpus(jax.vmap(_changes), np.ones(3, bool), none, none, genomes)
    assert len(texts) == 2
    for text in texts:
        assemble(text, tmp_path)


def test_eighty_generations_are_the_same_to_the_bit() -> None:
    """Of genomes that reach the limits of their arrays, in several species; two trials at once."""
    size = nodes, connections = 33, 40  # more nodes than a word has bits
    chosen = Settings(
        population=24,
        nodes=nodes,
        connections=connections,
        mutation=Mutation(node_add=0.7, connection_add=0.7, weight=Attribute(mutate_rate=0.5)),
        species=Species(most=5, threshold=1.5, exempt=1, survival=0.4),
    )

    def evolution(start: Any, key: Any, fitness: Any) -> Any:
        def generation(population: Any, drawn: Any) -> Any:
            following = next_population(drawn[0], chosen, [size], population, drawn[1], INPUTS, OUTPUTS)
            return following, (following.species.count, following.genomes)

        return jax.lax.scan(generation, start, (jax.random.split(key, 80), fitness))

    fitness = np.random.default_rng(5).integers(0, 8, (2, 80, 24)).astype(np.float32)
    start = jax.jit(jax.vmap(lambda key: first_population(key, chosen, INPUTS, OUTPUTS)))(
        jax.random.split(jax.random.key(5))
    )
    with jax.debug_key_reuse(False):  # jax takes the keys of a condition under vmap for used
        by_kernels, without = (
            jax.device_get(each(start, jax.random.split(jax.random.key(6)), fitness))
            for each in _both_ways(jax.vmap(evolution))
        )
    assert same(by_kernels, without)
    species, genomes = by_kernels[1]
    assert (genomes.node_count.max(), genomes.connection_count.max()) == size
    assert (species.max(axis=1) > 1).all()
