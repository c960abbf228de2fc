"""Networks of genomes worked out by hand, alone and in batches."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.core.errors import UnknownNameError
from evoclaims.networks.genome import EMPTY, Connections, Genome, Nodes
from evoclaims.networks.graph import GraphNetwork, Wiring

pytestmark = pytest.mark.newest

Gene = tuple[int, float, float, int]
"""Key, bias, response, activation."""


def _genome(nodes: Sequence[Gene], weights: dict[tuple[int, int], float], capacity: int = 8) -> Genome:
    """Return a genome of these nodes, in this order, and these weights by the keys of both ends."""
    keys = [node[0] for node in nodes]
    rest, spare = capacity - len(nodes), 2
    columns = list(zip(*nodes, strict=True))
    return Genome(
        nodes=Nodes(
            key=jnp.array([*keys, *[EMPTY] * rest], jnp.int32),
            bias=jnp.array([*columns[1], *[0] * rest], jnp.float32),
            response=jnp.array([*columns[2], *[0] * rest], jnp.float32),
            activation=jnp.array([*columns[3], *[0] * rest], jnp.int32),
        ),
        connections=Connections(
            source=jnp.array([*[keys.index(s) for s, _ in weights], *[0] * spare], jnp.int32),
            target=jnp.array([*[keys.index(t) for _, t in weights], *[0] * spare], jnp.int32),
            weight=jnp.array([*weights.values(), *[0] * spare], jnp.float32),
        ),
        node_count=jnp.asarray(len(nodes), jnp.int32),
        connection_count=jnp.asarray(len(weights), jnp.int32),
    )


INPUTS: list[Gene] = [(0, 9.0, 9.0, 0), (1, 9.0, 9.0, 0)]
"""An input's own bias and response play no part."""
NETWORK = GraphNetwork(2, 2)


def _answer(network: GraphNetwork, genome: Genome, *observation: float) -> Any:
    return jax.jit(network.apply)(network.express(genome), jnp.array(observation, jnp.float32))


def test_a_node_computes_its_activation_of_bias_plus_response_times_the_weighted_sum() -> None:
    genome = _genome(
        [*INPUTS, (5, 0.25, 2.0, 0), (2, -0.5, 3.0, 0), (3, 0.125, 1.0, 0)],
        {(0, 5): 0.5, (1, 5): -0.75, (5, 2): 1.5, (0, 2): 0.25, (1, 3): 2.0},
    )
    hidden = np.tanh(0.25 + 2.0 * (0.5 * 0.3 - 0.75 * 0.8))
    wanted = [np.tanh(-0.5 + 3.0 * (1.5 * hidden + 0.25 * 0.3)), np.tanh(0.125 + 2.0 * 0.8)]
    np.testing.assert_allclose(_answer(NETWORK, genome, 0.3, 0.8), wanted, rtol=1e-5)


def test_an_output_passes_its_plain_sum_on_and_is_read_through_the_output_function() -> None:
    genome = _genome([*INPUTS, (3, 0.5, 2.0, 0), (2, 0.0, 1.0, 0)], {(0, 3): 1.5, (3, 2): 1.0})
    z = 0.5 + 2.0 * 1.5 * 0.5
    np.testing.assert_allclose(_answer(NETWORK, genome, 0.5, 0.0), [np.tanh(z), np.tanh(z)], rtol=1e-5)
    sigmoid = GraphNetwork(2, 2, ("abs",), "sigmoid")
    np.testing.assert_allclose(_answer(sigmoid, genome, 0.5, 0.0), [1 / (1 + np.exp(-z))] * 2, rtol=1e-5)


def test_every_hidden_node_has_its_own_function_and_outputs_have_none_of_them() -> None:
    network = GraphNetwork(2, 2, ("sin", "gauss", "abs", "identity", "sigmoid", "tanh"), "identity")
    hidden = [(4 + i, 0.1, 1.0, i) for i in range(6)]
    weights = {(0, 4 + i): 1.0 for i in range(6)} | {(4 + i, 2): 1.0 for i in range(6)} | {(0, 3): 1.0}
    genome = _genome([*INPUTS, *hidden, (2, 0.0, 1.0, 5), (3, 0.0, 1.0, 1)], weights, capacity=10)
    z = -1.4
    wanted = np.sin(z) + np.exp(-z * z) + abs(z) + z + 1 / (1 + np.exp(-z)) + np.tanh(z)
    np.testing.assert_allclose(_answer(network, genome, z - 0.1, 0.0), [wanted, z - 0.1], rtol=1e-5)


UNFED = _genome(
    [*INPUTS, (6, 1.0, 1.0, 0), (7, 2.0, 1.0, 0), (2, 0.5, 1.0, 0), (3, 3.0, 1.0, 0)],
    {(6, 7): 1.0, (7, 2): 1.0, (0, 2): 1.0, (7, 3): 5.0},
)
"""Nothing leads to 6, so that 7 gets nothing, nor does output 3; output 2 hears input 0 alone."""


def test_a_node_that_nothing_reaches_emits_nothing_and_an_output_is_then_read_as_0() -> None:
    cosine = GraphNetwork(2, 2, ("tanh",), "gauss")
    np.testing.assert_allclose(_answer(NETWORK, UNFED, 0.25, 1.0), [np.tanh(0.75), 0.0], rtol=1e-6)
    np.testing.assert_allclose(_answer(cosine, UNFED, 0.25, 1.0), [np.exp(-(0.75**2)), 0.0], rtol=1e-6)


def test_a_weight_of_0_reaches_a_node_all_the_same() -> None:
    genome = _genome([*INPUTS, (2, 0.5, 1.0, 0), (3, 0.25, 1.0, 0)], {(0, 2): 0.0})
    np.testing.assert_allclose(_answer(NETWORK, genome, 1.0, 1.0), [np.tanh(0.5), 0.0], rtol=1e-6)


PARTLY = _genome(
    [*INPUTS, (5, 1.0, 1.0, 0), (2, 0.5, 1.0, 0), (3, 0.25, 1.0, 0)],
    {(0, 5): 1.0, (5, 2): 1.0, (1, 2): 1.0, (0, 3): 1.0},
)


@pytest.mark.parametrize(
    ("observation", "wanted"),
    [
        ((0.5, 0.25), [np.tanh(0.5 + np.tanh(1.5) + 0.25), np.tanh(0.75)]),
        ((np.nan, 0.25), [np.tanh(0.75), 0.0]),
        ((0.5, np.nan), [np.tanh(0.5 + np.tanh(1.5)), np.tanh(0.75)]),
        ((np.nan, np.nan), [0.0, 0.0]),
    ],
)
def test_an_input_that_is_not_a_number_emits_nothing(observation: tuple[float, ...], wanted: list[float]) -> None:
    np.testing.assert_allclose(_answer(NETWORK, PARTLY, *observation), wanted, rtol=1e-5)


ROWS = jnp.array([[0.5, 0.25], [np.nan, 0.25], [0.5, np.nan], [np.nan, np.nan], [-1.0, 2.0]])


@pytest.mark.parametrize("rows", [ROWS, ROWS[1:2]], ids=["many", "one"])
def test_all_ways_to_batch_agree_row_by_row(rows: Any) -> None:
    graphs = [NETWORK.express(genome) for genome in (PARTLY, UNFED)]
    population: Wiring = jax.tree.map(lambda *leaf: jnp.stack(leaf), *graphs)
    wanted = [[np.asarray(NETWORK.apply(graph, row)) for row in rows] for graph in graphs]
    apply = NETWORK.apply
    by_row = jax.jit(jax.vmap(apply, (None, 0)))
    for graph, one in zip(graphs, wanted, strict=True):
        np.testing.assert_allclose(by_row(graph, rows), one, atol=1e-6)
        np.testing.assert_allclose(jax.vmap(partial(NETWORK.propagate, NETWORK.matrices(graph)))(rows), one, atol=1e-6)
    genomes_of_rows = jax.jit(jax.vmap(jax.vmap(apply, (None, 0)), (0, None)))(population, rows)
    np.testing.assert_allclose(genomes_of_rows, wanted, atol=1e-6)
    rows_of_genomes = jax.jit(jax.vmap(jax.vmap(apply, (0, None)), (None, 0)))(population, rows)
    np.testing.assert_allclose(np.swapaxes(rows_of_genomes, 0, 1), wanted, atol=1e-6)
    each_its_own = jax.jit(jax.vmap(apply))(population, rows[:2] if len(rows) > 1 else jnp.stack([rows[0]] * 2))
    theirs = [wanted[i][min(i, len(rows) - 1)] for i in range(2)]
    np.testing.assert_allclose(each_its_own, theirs, atol=1e-6)


def test_the_matrix_is_strictly_lower_triangular() -> None:
    graph = NETWORK.matrices(NETWORK.express(UNFED))
    linked = np.asarray(graph.linked)
    assert linked.sum() == 4
    assert not np.triu(linked).any()
    assert (np.asarray(graph.weights)[~linked] == 0).all()


@pytest.mark.parametrize("names", [{"activations": ("tanh", "step")}, {"output": "step"}])
def test_an_unknown_function_is_one_sentence(names: dict[str, Any]) -> None:
    with pytest.raises(UnknownNameError, match="step"):
        GraphNetwork(1, 1, **names)
