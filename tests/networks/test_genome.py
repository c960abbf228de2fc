"""Genomes as arrays: which places hold genes, where the outputs are, and other capacities."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.networks.genome import EMPTY, Connections, Genome, Nodes, resized


def _genome() -> Genome:
    """Return nodes 0, 1, 7, 3, 2 (two inputs, two outputs) and three connections, with places to spare."""
    return Genome(
        nodes=Nodes(
            key=jnp.array([0, 1, 7, 3, 2, EMPTY, EMPTY], jnp.int32),
            bias=jnp.array([1.0, 2.0, 3.0, 4.0, 5.0, 0.0, 0.0]),
            response=jnp.array([6.0, 7.0, 8.0, 9.0, 10.0, 0.0, 0.0]),
            activation=jnp.array([1, 2, 3, 4, 5, 0, 0], jnp.int32),
        ),
        connections=Connections(
            source=jnp.array([0, 2, 1, 0], jnp.int32),
            target=jnp.array([2, 4, 3, 0], jnp.int32),
            weight=jnp.array([0.5, -0.5, 2.0, 0.0]),
        ),
        node_count=jnp.asarray(5, jnp.int32),
        connection_count=jnp.asarray(3, jnp.int32),
    )


def _plain(genome: Genome) -> list[Any]:
    return [np.asarray(leaf).tolist() for leaf in jax.tree.leaves(genome)]


def test_a_larger_capacity_adds_empty_places() -> None:
    large = resized(_genome(), 9, 6)
    assert np.asarray(large.nodes.key).tolist() == [0, 1, 7, 3, 2, EMPTY, EMPTY, EMPTY, EMPTY]
    for leaf in (large.nodes.bias, large.nodes.response, large.nodes.activation):
        assert leaf.shape == (9,)
        assert not np.asarray(leaf)[5:].any()
    for leaf in jax.tree.leaves(large.connections):
        assert leaf.shape == (6,)
        assert not np.asarray(leaf)[3:].any()
    assert (int(large.node_count), int(large.connection_count)) == (5, 3)


@pytest.mark.parametrize(("nodes", "connections"), [(5, 3), (9, 3), (5, 9), (9, 9)])
def test_there_and_back_is_the_same_genome_with_its_dtypes(nodes: int, connections: int) -> None:
    genome, other = _genome(), resized(_genome(), nodes, connections)
    back = resized(other, 7, 4)
    assert _plain(back) == _plain(genome)
    assert [leaf.dtype for leaf in jax.tree.leaves(other)] == [leaf.dtype for leaf in jax.tree.leaves(genome)]


def test_a_population_is_resized_as_its_genomes_are() -> None:
    population = jax.tree.map(lambda leaf: jnp.stack([leaf] * 3), _genome())
    for alone, one in zip(_plain(resized(_genome(), 8, 3)), _plain(resized(population, 8, 3)), strict=True):
        assert one == [alone] * 3
