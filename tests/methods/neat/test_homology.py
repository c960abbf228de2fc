"""Homologous genes are those with equal keys, wherever they lie."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from assembler import assemble, kernels_for_gpus
from block_machine import run
from genomes import at, dags, made, same, stacked
from hypothesis import given, settings
from hypothesis import strategies as st
from without_kernels import BREEDING, without_kernels

from evoclaims.kernels.emit import group_kernel
from evoclaims.kernels.emit.gpu_kernel import GpuProgram
from evoclaims.methods.neat.homology import (
    Counterparts,
    _by_comparison,
    _by_matrix,
    _look_up,
    counterparts,
    counterparts_in_pairs,
)
from evoclaims.networks.genome import Genome

pytestmark = pytest.mark.newest

_counterparts = jax.jit(counterparts)
MAPS: dict[str, Any] = {
    "all with one": jax.vmap(counterparts, (0, None)),
    "trials": jax.vmap(jax.vmap(counterparts, (0, None))),
    "pairs of parents": jax.vmap(counterparts_in_pairs),
}
"""Batches of genomes, and of others, as a generation has them."""


def _in_batch(name: str, genomes: Genome, others: Genome) -> tuple[Genome, Genome]:
    """Return what a batch is given of some genomes and as many others."""
    if name == "trials":
        return jax.tree.map(lambda leaf: jnp.stack([leaf, leaf[::-1]]), genomes), at(others, np.array([0, -1]))
    return genomes, at(others, 0) if name == "all with one" else others


@cache
def _compiled(name: str, kernel: bool) -> Any:
    """Return the function that finds what a batch has in common, 0 where it is arbitrary."""

    def found(*genomes: Genome) -> Any:
        found: Counterparts = MAPS[name](*_in_batch(name, *genomes))
        nodes = found.nodes
        attributes = [jnp.where(found.has_node, each, 0) for each in (nodes.bias, nodes.response, nodes.activation)]
        return found.has_node, attributes, jax.lax.bitcast_convert_type(found.weight, jnp.int32), found.has_connection

    return jax.jit(found)


def _check_both_ways(name: str, genomes: Genome, others: Genome) -> None:
    """Assert that the kernel finds the same bits as the function in jax."""
    made = _compiled(name, True)(genomes, others)
    with without_kernels(BREEDING):
        wanted = _compiled(name, False)(genomes, others)
    assert same(made, wanted)


def test_genes_of_another_order_and_of_neighbouring_large_keys_are_told_apart() -> None:
    big = 2**24
    one = made([0, 1, big, big + 1, 2], {(0, big): 1.0, (big, 2): 2.0, (0, big + 1): 3.0})
    other = made([0, 1, big + 1, 2, big + 2], {(0, big + 1): 4.0, (big + 1, 2): 5.0})
    found = _counterparts(one, other)
    assert np.asarray(found.has_node).tolist()[:5] == [True, True, False, True, True]
    np.testing.assert_array_equal(np.asarray(found.weight)[:4], [np.nan, np.nan, 4.0, np.nan])


@pytest.mark.parametrize("name", MAPS)
@settings(max_examples=15, deadline=None)
@given(st.lists(dags(activations=3), min_size=3, max_size=3), st.lists(dags(activations=3), min_size=3, max_size=3))
def test_the_kernel_finds_the_same_bits_in_every_batch(name: str, genomes: list[Genome], others: list[Genome]) -> None:
    """An only genome is the other's row; genomes with the same other are rows of a group."""
    for count in (1, 3):
        _check_both_ways(name, stacked(genomes[:count]), stacked(others[:count]))


@pytest.mark.parametrize("capacity", [(100, 400), (33, 7), (1, 1)])
def test_the_kernel_finds_the_same_bits_at_other_capacities(capacity: tuple[int, int]) -> None:
    """Also among genomes that fill their arrays, and keys that share a hash."""
    draw = np.random.default_rng(3)
    nodes, connections = capacity
    pairs = [(s, t) for s in range(nodes) for t in range(s + 1, nodes)]

    def drawn(full: bool) -> Genome:
        order = np.sort(draw.choice(3 * nodes, nodes if full else draw.integers(nodes + 1), replace=False)) * 2**16
        links = [(order[s], order[t]) for s, t in pairs if t < len(order)]
        chosen = draw.permutation(len(links))[: connections if full else draw.integers(connections + 1)]
        return made(order.tolist(), {links[i]: draw.normal() for i in chosen}, capacity=capacity)

    genomes, others = (stacked([drawn(full) for full in (True, True, False, False)]) for _ in range(2))
    for name in MAPS:
        _check_both_ways(name, genomes, others)


def test_numbers_are_moved_as_bits() -> None:
    """A weight of NaN counts as missing."""
    payload = np.uint32(0x7FC12345).view(np.float32)
    odd = [float("inf"), -0.0, 1e-45, payload]
    genome = made([0, 1, 2, 3], {(0, 1): 1.0, (0, 2): 1.0, (0, 3): 1.0, (1, 2): 1.0})
    weights, biases = (np.concatenate([odd, rest[4:]]) for rest in (genome.connections.weight, genome.nodes.bias))
    strange = replace(
        genome,
        connections=replace(genome.connections, weight=weights.astype(np.float32)),
        nodes=replace(genome.nodes, bias=biases.astype(np.float32)),
    )
    found = _counterparts(genome, strange)
    assert np.asarray(found.has_connection).tolist()[:4] == [True, True, True, False]
    assert np.asarray(found.weight).tobytes()[:16] == weights.astype(np.float32).tobytes()[:16]
    assert np.asarray(found.nodes.bias).tobytes()[:16] == biases.astype(np.float32).tobytes()[:16]


def _ends(genomes: Genome) -> Any:
    """Return where each connection of a genome's neighbour leads from and to, -1 where it is nowhere."""
    draw, genes = np.random.default_rng(1), jax.tree.map(lambda leaf: np.roll(leaf, 1, 0), genomes.connections)
    return [np.where(draw.random(leaf.shape) < 0.2, -1, leaf).astype(np.int32) for leaf in (genes.source, genes.target)]


@jax.jit
def _weights_both_ways(genomes: Genome, source: Any, target: Any) -> Any:
    """Return the bits of the weights between slots, by comparison and by matrices; 0 for slots of -1."""
    there = (source >= 0) & (target >= 0)
    return [
        jnp.where(there, jax.lax.bitcast_convert_type(jax.vmap(way)(genomes, source, target), jnp.int32), 0)
        for way in (_by_comparison, _by_matrix)
    ]


@settings(max_examples=40, deadline=None)
@given(st.lists(dags(activations=3), min_size=3, max_size=3))
def test_comparing_all_connections_finds_the_weights_that_a_matrix_has(genomes: list[Genome]) -> None:
    by_comparison, by_matrix = _weights_both_ways(stacked(genomes), *_ends(stacked(genomes)))
    np.testing.assert_array_equal(by_comparison, by_matrix)


@pytest.mark.parametrize("connections", [1, 4, 7, 24])
def test_a_gpus_threads_find_the_weight_of_a_number_and_nan_for_what_is_not_there(connections: int) -> None:
    """In lists of all lengths, at every place; a weight of NaN is moved as it is."""
    kernel, full = _look_up(connections), connections + -connections % 4
    counts = np.arange(connections + 1, dtype=np.int32)
    links = np.where(np.arange(full) < counts[:, None], 10 * np.arange(full) + counts[:, None], -2).astype(np.int32)
    weights = np.random.default_rng(2).normal(size=(len(counts), connections)).astype(np.float32)
    weights.view(np.uint32)[:, -1] = 0x7FC12345
    absent = np.broadcast_to(np.int32([-1, 3, 10**6]), (len(counts), 3))
    wanted = np.concatenate([np.where(links == -2, -1, links), absent], axis=1)
    groups, rows = wanted.shape
    text = group_kernel.gpu_text(kernel.write, kernel.sizes, groups, rows, [True])
    result = [jax.ShapeDtypeStruct((groups, rows), jnp.float32)]
    program = GpuProgram("", kernel.name)
    (made_,) = run(text, program, groups * rows, [links, weights, counts, wanted.reshape(-1)], result)
    expected = np.full(wanted.shape, np.nan, np.float32)
    for group, count in enumerate(counts):
        expected[group, :count] = weights[group, :count]
        if count == 3:
            expected[group, full + 1] = weights[group, 0]
    np.testing.assert_array_equal(made_.view(np.uint32), expected.view(np.uint32))


@pytest.mark.parametrize("name", MAPS)
def test_on_gpus_a_thread_searches_for_one_node(name: str, tmp_path: Path) -> None:
    genomes = stacked([made([0, 1, 2], {(0, 2): 1.0})] * 3)
    search, *look_up = kernels_for_gpus(MAPS[name], *_in_batch(name, genomes, genomes))
    assert ".entry the_search_for_homologous_nodes(" in search
    assert len(look_up) == (name == "pairs of parents")
    for ptx in (search, *look_up):
        assemble(ptx, tmp_path)
