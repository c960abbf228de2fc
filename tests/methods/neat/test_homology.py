"""Homologous genes are those with equal keys, wherever they lie."""

from __future__ import annotations

import jax
import numpy as np
from genomes import dags, made, read
from hypothesis import given, settings

from evoclaims.methods.neat.homology import counterparts, index
from evoclaims.networks.genome import Genome

_counterparts = jax.jit(lambda genome, other: counterparts(genome, index(other)))


@settings(max_examples=80, deadline=None)
@given(dags(activations=3), dags(activations=3))
def test_every_gene_finds_the_gene_with_its_keys(genome: Genome, other: Genome) -> None:
    found, ours, theirs = jax.device_get(_counterparts(genome, other)), read(genome), read(other)
    for slot, key in enumerate(ours.nodes):
        assert found.has_node[slot] == (key in theirs.nodes)
        if key in theirs.nodes:
            gene = theirs.nodes[key]
            attributes = (found.nodes.bias[slot], found.nodes.response[slot], found.nodes.activation[slot])
            assert attributes == (gene.bias, gene.response, gene.activation)
    assert not found.has_node[len(ours.nodes) :].any()
    for place, ends in enumerate(ours.connections):
        assert found.has_connection[place] == (ends in theirs.connections)
        if ends in theirs.connections:
            assert found.weight[place] == theirs.connections[ends]
    assert not found.has_connection[len(ours.connections) :].any()


def test_genes_of_another_order_and_of_neighbouring_large_keys_are_told_apart() -> None:
    big = 2**24
    one = made([0, 1, big, big + 1, 2], {(0, big): 1.0, (big, 2): 2.0, (0, big + 1): 3.0})
    other = made([0, 1, big + 1, 2, big + 2], {(0, big + 1): 4.0, (big + 1, 2): 5.0})
    found = _counterparts(one, other)
    assert np.asarray(found.has_node).tolist()[:5] == [True, True, False, True, True]
    np.testing.assert_array_equal(np.asarray(found.weight)[:4], [np.nan, np.nan, 4.0, np.nan])
