"""Genomes as JSON: nothing is lost."""

from __future__ import annotations

import json
from typing import Any

import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.networks.export import genome_json
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


@settings(deadline=None)
@given(st.lists(FLOATS, min_size=14, max_size=14))
def test_json_holds_every_gene_to_the_bit(numbers: list[float]) -> None:
    plain = json.loads(genome_json(_genome(np.array(numbers, np.float32)), NETWORK))
    assert (plain["inputs"], plain["outputs"], plain["activations"]) == (2, 2, ["sin", "abs", "gauss"])
    assert (plain["output"], plain["capacity"]) == ("sigmoid", {"nodes": 7, "connections": 5})
    assert [(node["key"], node["activation"]) for node in plain["nodes"]] == [(0, 0), (1, 0), (7, 2), (3, 1), (2, 0)]
    assert [(one["source"], one["target"]) for one in plain["connections"]] == [(0, 7), (7, 2), (1, 3), (3, 2)]
    written = [node["bias"] for node in plain["nodes"]] + [node["response"] for node in plain["nodes"]]
    written += [one["weight"] for one in plain["connections"]]
    assert np.array(list(map(np.float32, written))).tobytes() == _with_one_nan(numbers).tobytes()


def _with_one_nan(numbers: list[float]) -> Any:
    """Return float32s in which every NaN is the same: JSON has a word for it, and none for its payload."""
    values = np.array(numbers, np.float32)
    return np.where(np.isnan(values), np.float32("nan"), values)


def test_json_is_standard_json_with_a_gene_a_line() -> None:
    text = genome_json(_genome([float("inf")] * 14), NETWORK)

    def refuse(word: str) -> None:
        raise AssertionError(word)

    plain = json.loads(text, parse_constant=refuse)
    assert plain["nodes"][2] == {"key": 7, "bias": "inf", "response": "inf", "activation": 2}
    assert plain["connections"][3] == {"source": 3, "target": 2, "weight": "inf"}
    assert sum('"key"' in line for line in text.splitlines()) == 5
