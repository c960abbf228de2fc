"""A child has its fitter parent's structure, and of homologous genes either parent's numbers."""

from __future__ import annotations

import jax
import numpy as np
from genomes import check, dags, made, read, same
from hypothesis import given, settings
from hypothesis import strategies as st
from reference import Node
from scipy.stats import binomtest

from evoclaims.methods.neat.homology import crossover
from evoclaims.networks.genome import Genome

_crossover = jax.jit(crossover)
A_FEW = settings(max_examples=80, deadline=None)


@A_FEW
@given(dags(activations=3), dags(activations=3), st.integers(0, 2**31 - 1))
def test_a_childs_attributes_are_either_parents_and_its_structure_is_the_fitters(
    fitter: Genome, other: Genome, seed: int
) -> None:
    child = jax.device_get(_crossover(jax.random.key(seed), fitter, other))
    check(jax.tree.map(lambda leaf: leaf[None], child), 2, 2, activations=3)
    ours, first, second = read(child), read(fitter), read(other)
    assert child.nodes.key.tolist() == fitter.nodes.key.tolist()
    assert child.connections.source.tolist() == fitter.connections.source.tolist()
    assert child.connections.target.tolist() == fitter.connections.target.tolist()
    assert ours.connections.keys() == first.connections.keys()
    for key, gene in ours.nodes.items():
        if key not in second.nodes:
            assert gene == first.nodes[key]
        for name in ("bias", "response", "activation"):
            choices = [getattr(parent.nodes[key], name) for parent in (first, second) if key in parent.nodes]
            assert getattr(gene, name) in choices
    for ends, weight in ours.connections.items():
        assert weight in [parent.connections[ends] for parent in (first, second) if ends in parent.connections]
        if ends not in second.connections:
            assert weight == first.connections[ends]


@A_FEW
@given(dags(activations=3), st.integers(0, 2**31 - 1))
def test_a_parent_crossed_with_itself_is_unchanged(genome: Genome, seed: int) -> None:
    assert same(_crossover(jax.random.key(seed), genome, genome), genome)


def test_half_of_the_numbers_come_from_each_parent_each_on_its_own() -> None:
    ends = [(s, t) for s in (0, 1) for t in (2, 3, 4, 5)]
    parents = [
        made([0, 1, 4, 5, 2, 3], dict.fromkeys(ends, x), dict.fromkeys(range(6), Node(x, x, int(x))))
        for x in (0.0, 1.0)
    ]
    keys = jax.random.split(jax.random.key(2), 500)
    children = jax.device_get(jax.jit(jax.vmap(_crossover, (0, None, None)))(keys, *parents))
    columns = [children.nodes.bias[:, :6], children.nodes.response[:, :6], children.nodes.activation[:, :6]]
    genes = np.concatenate([*columns, children.connections.weight[:, :8]], axis=1)
    for gene in genes.T:
        assert binomtest(int(gene.sum()), len(keys), 0.5).pvalue > 1e-5
    correlations = np.corrcoef(genes.T)[np.triu_indices(genes.shape[1], 1)]
    assert np.abs(correlations).max() < 5 / np.sqrt(len(keys))
