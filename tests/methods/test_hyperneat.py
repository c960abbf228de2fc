"""HyperNEAT's networks against a CPPN asked pair by pair in plain NumPy, and what is special to the method."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.hyperneat import CPPN_FUNCTIONS, PAPER, HyperNeat, SubstrateNetwork
from evoclaims.methods.neat import settings as neat
from evoclaims.methods.neat.settings import Settings, Species
from evoclaims.networks.genome import EMPTY, Connections, Genome, Nodes
from evoclaims.networks.graph import GraphNetwork
from evoclaims.networks.substrate import Substrate, layered, on_circle

pytestmark = pytest.mark.newest

NAMES = (*CPPN_FUNCTIONS, "sigmoid")
FUNCTIONS: dict[str, Callable[[float], float]] = {
    "tanh": np.tanh,
    "sigmoid": lambda z: 1 / (1 + np.exp(-z)),
    "sin": np.sin,
    "gauss": lambda z: np.exp(-z * z),
    "abs": abs,
    "identity": lambda z: z,
}
TASK = NParity(2)
LAYERED = layered((3, 4, 3, 2), "unit")
QUARTERS = [0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi]
ROBOT = Substrate(
    (
        (*on_circle(QUARTERS), (0.0, 0.0)),
        on_circle(np.linspace(0, 2 * np.pi, 8, endpoint=False).tolist(), 0.25),
        on_circle(QUARTERS, 0.5),
    )
)
"""Four sensors and the bias, hidden neurons, and four actuators, each where it points."""


def _ask(genome: Genome, functions: Sequence[str], output: str, query: Sequence[float]) -> float:
    """Return the answer of a genome's network with one output to one query, node by node in float64."""
    nodes, connections = genome.nodes, genome.connections
    emitted: dict[int, float] = dict(enumerate(query))
    for slot in range(len(query), int(genome.node_count)):
        places = [c for c in range(int(genome.connection_count)) if connections.target[c] == slot]
        heard = [
            float(connections.weight[c]) * emitted[int(connections.source[c])]
            for c in places
            if int(connections.source[c]) in emitted
        ]
        if heard:
            z = float(nodes.bias[slot]) + float(nodes.response[slot]) * sum(heard)
            is_output = int(nodes.key[slot]) == len(query)
            emitted[slot] = z if is_output else float(FUNCTIONS[functions[int(nodes.activation[slot])]](z))
    (slot_of_output,) = np.flatnonzero(np.asarray(nodes.key) == len(query)).tolist()
    return float(FUNCTIONS[output](emitted[slot_of_output])) if slot_of_output in emitted else 0.0


def _weight(q: float, threshold: float, max_weight: float) -> float:
    """Return the weight of a connection for which the CPPN has answered q."""
    if abs(q) < threshold:
        return 0.0
    return float(np.sign(q)) * (abs(q) - threshold) / (1 - threshold) * max_weight


def _drawn(network: SubstrateNetwork, genome: Genome) -> list[NDArray[np.float64]]:
    """Return the weights [to, from] into each layer but the first, asked for one by one."""
    layers = network.substrate.layers
    return [
        np.array(
            [
                [
                    _weight(
                        _ask(genome, network.cppn.activations, network.cppn.output, (*source, *target)),
                        network.threshold,
                        network.max_weight,
                    )
                    for source in before
                ]
                for target in after
            ]
        )
        for before, after in itertools.pairwise(layers)
    ]


def _any_genome(drawing: np.random.Generator, nodes: int = 12, connections: int = 30) -> Genome:
    """Draw a CPPN of any functions, its output anywhere among its hidden nodes, and some nodes fed by nothing."""
    keys = [0, 1, 2, 3, *drawing.permutation(np.arange(4, 4 + drawing.integers(1, nodes - 3))).tolist()]
    pairs = [(source, target) for target in range(4, len(keys)) for source in range(target)]
    count = min(int(drawing.integers(1, connections + 1)), len(pairs))
    ends = drawing.permutation(pairs)[:count].T
    genes, links = (0, nodes - len(keys)), (0, connections - count)

    def gene(values: Any) -> NDArray[np.float32]:
        return np.pad(np.float32(values), genes)

    return Genome(
        nodes=Nodes(
            key=np.pad(np.int32(keys), genes, constant_values=EMPTY),
            bias=gene(drawing.normal(size=len(keys))),
            response=gene(drawing.normal(1, 0.3, size=len(keys))),
            activation=np.pad(np.int32(drawing.integers(0, len(NAMES), len(keys))), genes),
        ),
        connections=Connections(
            source=np.pad(np.int32(ends[0]), links),
            target=np.pad(np.int32(ends[1]), links),
            weight=np.pad(np.float32(drawing.normal(size=count)), links),
        ),
        node_count=np.int32(len(keys)),
        connection_count=np.int32(count),
    )


DRAWING = np.random.default_rng(1)
CPPNS = [_any_genome(DRAWING) for _ in range(60)]


@pytest.mark.parametrize(
    ("substrate", "threshold", "max_weight"), [(LAYERED, 0.3, 5.0), (ROBOT, 0.75, 2.0)], ids=["layered", "robot"]
)
def test_the_drawn_network_is_a_dense_one_with_the_weights_that_the_cppn_answers(
    substrate: Substrate, threshold: float, max_weight: float
) -> None:
    network = SubstrateNetwork(substrate, GraphNetwork(4, 1, NAMES, "tanh"), threshold, max_weight)
    express, apply = jax.jit(network.express), jax.jit(network.apply)
    drawing = np.random.default_rng(0)
    kinds: set[str] = set()
    for genome in CPPNS:
        wanted, drawn = _drawn(network, genome), express(genome)
        assert [matrix.shape for matrix in drawn] == substrate.shapes
        for matrix, wanted_matrix in zip(drawn, wanted, strict=True):
            np.testing.assert_allclose(matrix, wanted_matrix, atol=1e-5)
            kinds |= {"none" if w == 0 else "positive" if w > 0 else "negative" for w in wanted_matrix.ravel()}
        observation = drawing.normal(size=len(substrate.layers[0]) - 1)
        signal = np.append(observation, 1.0)
        for matrix in map(np.float64, drawn):
            signal = np.array([np.tanh(sum(w * x for w, x in zip(row, signal, strict=True))) for row in matrix])
        answer = apply(drawn, jnp.float32(observation))
        np.testing.assert_allclose(answer, signal, atol=1e-5)
    assert kinds == {"none", "positive", "negative"}


def test_layers_are_the_observation_and_the_bias_then_the_hidden_ones_then_the_actions() -> None:
    assert HyperNeat().encoding(NParity(6)).substrate == layered((7, 16, 1))
    assert HyperNeat(hidden=(5, 4), extent="unit").encoding(TASK).substrate == layered((3, 5, 4, 1), "unit")
    assert HyperNeat(hidden=()).encoding(TASK).substrate.shapes == [(1, 3)]
    by_hand = Substrate((((0.0, 0.0), (1.0, 0.0), (2.0, 0.0)), ((0.0, 1.0),)))
    assert HyperNeat(substrate=by_hand).encoding(TASK).substrate == by_hand


def test_the_settings_numbers_reach_the_network() -> None:
    method = HyperNeat(replace(PAPER, output="identity"), threshold=0.25, max_weight=3.0)
    network = method.encoding(TASK)
    assert network.cppn == GraphNetwork(4, 1, CPPN_FUNCTIONS, "identity")
    assert (network.threshold, network.max_weight) == (0.25, 3.0)


def test_the_best_policy_is_the_drawn_network_of_the_champion() -> None:
    small = Settings(population=8, nodes=8, connections=16, activations=CPPN_FUNCTIONS, species=Species(most=2))
    method = HyperNeat(small, hidden=(3,), extent="unit")
    state = method.init(jax.random.key(3), TASK)
    policy, network = method.best(TASK, state), method.encoding(TASK)
    signal = np.array([0.25, -0.5, 1.0])
    for matrix in _drawn(network, jax.device_get(policy.parameters)):
        signal = np.tanh(matrix @ signal)
    np.testing.assert_allclose(policy(jnp.array([0.25, -0.5])), signal, atol=1e-5)
    assert np.all(np.abs(signal) > 1e-3), "the network draws nothing"


def test_the_papers_and_the_published_codes_values() -> None:
    assert HyperNeat().settings == PAPER
    assert replace(PAPER, activations=neat.PAPER.activations) == neat.PAPER
    assert (PAPER.population, PAPER.species.most, PAPER.mutation.node_add) == (5_000, 50, 0.2)
    assert set(PAPER.activations) > {"tanh"}
    assert HyperNeat().hidden == (16,)
    assert (HyperNeat().threshold, HyperNeat().max_weight) == (0.3, 5.0)


@pytest.mark.parametrize(
    ("threshold", "max_weight"), [(-0.1, 5.0), (1.0, 5.0), (np.nan, 5.0), (0.3, 0.0), (0.3, np.nan), (0.3, np.inf)]
)
def test_impossible_numbers_are_one_sentence(threshold: float, max_weight: float) -> None:
    with pytest.raises(UserError, match="HyperNEAT has threshold="):
        HyperNeat(threshold=threshold, max_weight=max_weight)


@pytest.mark.parametrize(("inputs", "outputs"), [(2, 1), (4, 1), (3, 2)])
def test_a_substrate_that_does_not_fit_the_task_is_one_sentence(inputs: int, outputs: int) -> None:
    method = HyperNeat(substrate=layered((inputs, outputs)))
    with pytest.raises(UserError, match=f"has {inputs} inputs and {outputs} outputs, but .* needs 3 .* and 1"):
        method.init(jax.random.key(0), TASK)
