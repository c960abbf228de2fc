"""Genomes as graphs and as JSON: nothing is lost, and what is no genome is told."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.core.errors import UserError
from evoclaims.networks.export import from_json, to_json, to_networkx
from evoclaims.networks.genome import EMPTY, Connections, Genome, Nodes
from evoclaims.networks.graph import GraphNetwork

NETWORK = GraphNetwork(2, 2, ("sin", "abs", "gauss"), "sigmoid")
FLOATS = st.floats(width=32)


def _genome(numbers: Any = None) -> Genome:
    """Return nodes 0, 1, 7, 3, 2 (two inputs, two outputs), with these 14 numbers, and places to spare."""
    values = jnp.asarray(np.arange(14) / 7 - 1 if numbers is None else numbers, jnp.float32)
    padding = jnp.zeros(2)
    return Genome(
        nodes=Nodes(
            key=jnp.array([0, 1, 7, 3, 2, EMPTY, EMPTY], jnp.int32),
            bias=jnp.concatenate([values[:5], padding]),
            response=jnp.concatenate([values[5:10], padding]),
            activation=jnp.array([0, 0, 2, 1, 0, 0, 0], jnp.int32),
        ),
        connections=Connections(
            source=jnp.array([0, 2, 1, 3, 0], jnp.int32),
            target=jnp.array([2, 4, 3, 4, 0], jnp.int32),
            weight=jnp.concatenate([values[10:14], jnp.zeros(1)]),
        ),
        node_count=jnp.asarray(5, jnp.int32),
        connection_count=jnp.asarray(4, jnp.int32),
    )


def _bits(genome: Genome) -> list[tuple[Any, ...]]:
    return [(x.shape, x.dtype, np.asarray(x).tobytes()) for x in jax.tree.leaves(genome)]


def test_the_graph_has_every_gene_under_its_historical_marking() -> None:
    graph = to_networkx(_genome(), NETWORK)
    assert list(graph) == [0, 1, 7, 3, 2]
    kinds = {0: "input", 1: "input", 7: "hidden", 3: "output", 2: "output"}
    functions = {0: "identity", 1: "identity", 7: "gauss", 3: "sigmoid", 2: "sigmoid"}
    for slot, key in enumerate(graph):
        assert graph.nodes[key] == {
            "kind": kinds[key],
            "bias": float(np.float32(slot / 7 - 1)),
            "response": float(np.float32((slot + 5) / 7 - 1)),
            "activation": functions[key],
        }
    weights = [float(np.float32((10 + i) / 7 - 1)) for i in range(4)]
    assert dict(graph.edges) == {
        ends: {"weight": weight} for ends, weight in zip([(0, 7), (7, 2), (1, 3), (3, 2)], weights, strict=True)
    }


@settings(deadline=None)
@given(st.lists(FLOATS, min_size=14, max_size=14))
def test_json_reads_back_to_the_same_bits(numbers: list[float]) -> None:
    genome = _genome(np.array(numbers, np.float32))
    back, network = from_json(to_json(genome, NETWORK))
    assert network == NETWORK
    # A NaN is a NaN, whatever its payload.
    plain = jax.tree.map(lambda x: jnp.where(jnp.isnan(x), jnp.nan, x) if x.dtype == jnp.float32 else x, genome)
    assert _bits(back) == _bits(plain)


def test_json_is_standard_json_with_a_gene_a_line() -> None:
    text = to_json(_genome([float("inf")] * 14), NETWORK)

    def refuse(word: str) -> None:
        raise AssertionError(word)

    plain = json.loads(text, parse_constant=refuse)
    assert plain["nodes"][2] == {"key": 7, "bias": "inf", "response": "inf", "activation": 2}
    assert plain["connections"][3] == {"source": 3, "target": 2, "weight": "inf"}
    assert sum('"key"' in line for line in text.splitlines()) == 5


def _edited(edit: Callable[[dict[str, Any]], Any]) -> str:
    plain = json.loads(to_json(_genome(), NETWORK))
    edit(plain)
    return json.dumps(plain)


@pytest.mark.parametrize(
    ("edit", "reason"),
    [
        (lambda p: p.pop("format"), 'it does not say "format": "evoclaims genome 1"'),
        (lambda p: p.pop("nodes"), "it does not have the fields"),
        (lambda p: p.update(more=1), "it does not have the fields"),
        (lambda p: p.update(inputs=True), "inputs is not a whole number from 1 to"),
        (lambda p: p.update(inputs=3), "its first nodes are not the inputs, 0 to 2"),
        (lambda p: p.update(outputs=3), "an output is missing, of 2 to 4"),
        (lambda p: p.update(activations=[]), "its activations are not a list of names"),
        (lambda p: p.update(activations=[1]), "an activation function is not a name"),
        (lambda p: p.update(output=["tanh"]), "an activation function is not a name"),
        (lambda p: p.update(capacity=7), "its capacity does not have the fields connections, nodes and no others"),
        (lambda p: p["capacity"].update(nodes=10**12), "the capacity of nodes is not a whole number from 0 to 1048576"),
        (lambda p: p["capacity"].update(connections=3), "its connections are not a list of at most 3, its capacity"),
        (lambda p: p.update(nodes={}), "its nodes are not a list of at most 7, its capacity"),
        (lambda p: p["nodes"].__setitem__(2, None), "node 3 does not have the fields"),
        (lambda p: p["nodes"][2].update(key=3), "two nodes have the same key"),
        (lambda p: p["nodes"][2].update(key=2**31), "a node's key is not a whole number"),
        (lambda p: p["nodes"][2].update(activation=3), "a node's activation is not a whole number from 0 to 2"),
        (lambda p: p["nodes"][2].update(bias="0"), "a bias is not a number"),
        (lambda p: p["nodes"][2].update(response=False), "a response is not a number"),
        (lambda p: p["nodes"].reverse(), "its first nodes are not the inputs, 0 to 1"),
        (lambda p: p["connections"][0].pop("weight"), "connection 1 does not have the fields source, target, weight"),
        (lambda p: p["connections"][0].update(weight=1e39), "a weight does not fit into 32 bits"),
        (lambda p: p["connections"][0].update(weight=float("nan")), "a weight does not fit into 32 bits"),
        (lambda p: p["connections"][0].update(source=9), "leads from 9 to 7, and one of them is no node"),
        (lambda p: p["connections"][0].update(source=2), "leads from 2 to 7, against the order of the nodes"),
        (lambda p: p["connections"][0].update(target=1), "leads from 0 to 1, against the order of the nodes"),
        (lambda p: p["connections"][2].update(source=0, target=7), "there are two connections from 0 to 7"),
    ],
)
def test_a_text_that_is_no_genome_is_told_with_the_reason(edit: Callable[[dict[str, Any]], Any], reason: str) -> None:
    with pytest.raises(UserError) as raised:
        from_json(_edited(edit))
    assert str(raised.value).startswith("This is not a genome as evoclaims writes it: ")
    assert reason in str(raised.value)


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "null", '{"format": 1}', "[" * 100_000, "1" * 5_000, "__import__('os')"]
)
def test_any_other_text_is_told_too(text: str) -> None:
    with pytest.raises(UserError, match="This is not a genome as evoclaims writes it"):
        from_json(text)


def test_an_unknown_activation_function_is_told_with_the_known_ones() -> None:
    with pytest.raises(UserError, match="no activation function named 'tahn'. Did you mean 'tanh'"):
        from_json(_edited(lambda p: p.update(output="tahn")))


def test_a_graph_without_networkx_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "networkx", None)
    with pytest.raises(UserError, match=r'networkx is not installed.*pip install "evoclaims\[pictures\]"'):
        to_networkx(_genome(), NETWORK)
    assert from_json(to_json(_genome(), NETWORK))[1] == NETWORK
