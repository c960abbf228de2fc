"""What a thousand evolved genomes answer, against a walk over dicts in float64."""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import numpy as np
import pytest
import reference
from genomes import read_all
from history import History

from evoclaims.networks.genome import Genome
from evoclaims.networks.graph import GraphNetwork

TOLERANCE = 1e-5
GENERATIONS = np.arange(8, 201, 16)
WHOLE = np.random.default_rng(0).normal(size=(6, 3)).astype(np.float32)
PARTIAL = np.array([[np.nan, 0.5, -1.0], [0.25, np.nan, np.nan], [np.nan] * 3, [1.0, 0.0, 1.0]], np.float32)
ROWS = np.concatenate([WHOLE, PARTIAL])


@pytest.fixture(scope="module")
def network(history: History) -> GraphNetwork:
    return GraphNetwork(history.inputs, history.outputs, history.settings.activations)


@pytest.fixture(scope="module")
def genomes(history: History) -> Genome:
    """Genomes of many ages."""
    chosen: Genome = jax.tree.map(
        lambda leaf: leaf[GENERATIONS].reshape(-1, *leaf.shape[2:]), history.populations.genomes
    )
    return chosen


@pytest.fixture(scope="module")
def wanted(history: History, genomes: Genome) -> Any:
    """Answers [genomes, rows, outputs] in float64."""
    names = history.settings.activations
    rows = ROWS.astype(np.float64)
    return np.array([reference.forward(genes, rows, history.outputs, names) for genes in read_all(genomes)])


@pytest.fixture(scope="module")
def graphs(network: GraphNetwork, genomes: Genome) -> Any:
    return jax.jit(jax.vmap(network.express))(genomes)


def test_the_genomes_are_many_and_of_many_kinds(genomes: Genome, wanted: Any) -> None:
    """There are outputs that nothing reaches, and outputs that feed other nodes."""
    nodes, genes = read_all(genomes), range(3, 5)
    assert len(wanted) >= 1000
    assert len(np.unique(genomes.node_count)) > 10
    assert sum(bool((answers[:6] == 0).all(axis=0).any()) for answers in wanted) > 20
    assert sum(any(source in genes for source, _ in one.connections) for one in nodes) > 100
    assert np.abs(wanted).max() <= 1.0


def test_rows_through_genomes(network: GraphNetwork, graphs: Any, wanted: Any) -> None:
    answers = jax.jit(jax.vmap(jax.vmap(network.apply, (None, 0)), (0, None)))(graphs, ROWS)
    np.testing.assert_allclose(answers, wanted, atol=TOLERANCE)


def test_rows_through_genomes_as_matrices(network: GraphNetwork, graphs: Any, wanted: Any) -> None:
    def answers_of(wiring: Any) -> Any:
        return jax.vmap(partial(network.propagate, network.matrices(wiring)))(ROWS)

    answers = jax.jit(jax.vmap(answers_of))(graphs)
    np.testing.assert_allclose(answers, wanted, atol=TOLERANCE)
