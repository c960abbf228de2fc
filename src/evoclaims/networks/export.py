"""Genomes for other programs: as a directed graph of networkx, and as plain JSON that reads back to the same bits."""

from __future__ import annotations

import importlib
import json
import math
from typing import Any, Final

import jax
import jax.numpy as jnp
import numpy as np

from evoclaims.core.canonical import as_plain
from evoclaims.core.errors import UserError
from evoclaims.networks.genome import EMPTY, Connections, Genome, Nodes
from evoclaims.networks.graph import GraphNetwork

FORMAT: Final = "evoclaims genome 1"

LARGEST: Final = 2**20
"""Most places for genes that a file may ask for: what is read must not fill the memory."""


def optional(module: str) -> Any:
    """Import a module of the extra `pictures`; a `UserError` tells how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise UserError(
            f"{module.partition('.')[0]} is not installed, which pictures and graphs of networks need: "
            'pip install "evoclaims[pictures]".'
        ) from error


def kind_of(key: int, network: GraphNetwork) -> str:
    """Return whether the node with this key is an "input", an "output" or "hidden"."""
    if key < network.inputs:
        return "input"
    return "output" if key < network.inputs + network.outputs else "hidden"


def to_networkx(genome: Genome, network: GraphNetwork) -> Any:
    """Return one genome's network as a `networkx.DiGraph`.

    Nodes, in topological order, are historical markings. Their attributes are `kind` ("input", "output", "hidden"),
    `bias`, `response` and `activation`, the name of the function applied: for an input "identity", for an output the
    network's output function, of which other nodes see the argument (see `networks.graph`). Edges have a `weight`.

    Raises:
        UserError: when networkx is not installed.
    """
    graph = optional("networkx").DiGraph()
    nodes, connections = _genes(genome)
    fixed = {"input": "identity", "output": network.output}
    for node in nodes:
        kind = kind_of(node["key"], network)
        function = fixed.get(kind, network.activations[node["activation"]])
        graph.add_node(node["key"], kind=kind, bias=node["bias"], response=node["response"], activation=function)
    for connection in connections:
        graph.add_edge(connection["source"], connection["target"], weight=connection["weight"])
    return graph


def to_json(genome: Genome, network: GraphNetwork) -> str:
    """Return one genome as JSON, a gene a line, from which `from_json` makes the same genome.

    Genes lie in the order of their places. A node's `activation` indexes `activations`; connections name the keys of
    both ends; numbers are written so that their float32 reads back, and those that are not finite as "nan", "inf",
    "-inf".
    """
    nodes, connections = _genes(genome)
    head = {
        "format": FORMAT,
        "inputs": network.inputs,
        "outputs": network.outputs,
        "activations": network.activations,
        "output": network.output,
        "capacity": {"nodes": genome.nodes.key.shape[0], "connections": genome.connections.weight.shape[0]},
    }
    parts = [f" {json.dumps(name)}: {json.dumps(value)}" for name, value in head.items()]
    for name, genes in (("nodes", nodes), ("connections", connections)):
        lines = ",".join("\n  " + json.dumps(as_plain(gene), allow_nan=False) for gene in genes)
        parts.append(f" {json.dumps(name)}: [{lines}]")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def from_json(text: str) -> tuple[Genome, GraphNetwork]:
    """Return the genome and the network that `to_json` has written, every promise of `Genome` checked.

    Raises:
        UserError: for a text that is not such a file; it says what is wrong.
    """
    plain = _loaded(text)
    inputs, outputs = (_whole(plain[name], name, 1, LARGEST) for name in ("inputs", "outputs"))
    activations = plain["activations"]
    if not isinstance(activations, list) or not activations:
        raise _wrong("its activations are not a list of names")
    if not all(isinstance(name, str) for name in (*activations, plain["output"])):
        raise _wrong("an activation function is not a name")
    network = GraphNetwork(inputs, outputs, tuple(activations), plain["output"])
    capacity = _fields(plain["capacity"], {"nodes", "connections"}, "its capacity")
    most = {name: _whole(value, f"the capacity of {name}", 0, LARGEST) for name, value in capacity.items()}
    for name, size in most.items():
        if not isinstance(plain[name], list) or len(plain[name]) > size:
            raise _wrong(f"its {name} are not a list of at most {size}, its capacity")
    nodes, slots = _nodes(plain["nodes"], most["nodes"], network)
    genome = Genome(
        nodes=nodes,
        connections=_connections(plain["connections"], most["connections"], slots, network),
        node_count=jnp.asarray(len(slots), jnp.int32),
        connection_count=jnp.asarray(len(plain["connections"]), jnp.int32),
    )
    return genome, network


def _genes(genome: Genome) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return a genome's nodes and connections as plain records."""
    host: Genome = jax.device_get(genome)
    keys = host.nodes.key.tolist()
    columns = [host.nodes.bias.tolist(), host.nodes.response.tolist(), host.nodes.activation.tolist()]
    names = ("key", "bias", "response", "activation")
    nodes = [dict(zip(names, row, strict=True)) for row in zip(keys, *columns, strict=True)]
    ends = zip(host.connections.source.tolist(), host.connections.target.tolist(), strict=True)
    connections = [
        {"source": keys[source], "target": keys[target], "weight": weight}
        for (source, target), weight in zip(ends, host.connections.weight.tolist(), strict=True)
    ]
    return nodes[: int(host.node_count)], connections[: int(host.connection_count)]


def _nodes(genes: list[Any], capacity: int, network: GraphNetwork) -> tuple[Nodes, dict[int, int]]:
    """Check and lay out node genes; return them with the slot of every key."""
    key, activation = np.full(capacity, EMPTY, np.int32), np.zeros(capacity, np.int32)
    bias, response = np.zeros((2, capacity), np.float32)
    for slot, gene in enumerate(genes):
        fields = _fields(gene, {"key", "bias", "response", "activation"}, f"node {slot + 1}")
        key[slot] = _whole(fields["key"], "a node's key", 0, 2**31 - 1)
        bias[slot] = _single(fields["bias"], "a bias")
        response[slot] = _single(fields["response"], "a response")
        activation[slot] = _whole(fields["activation"], "a node's activation", 0, len(network.activations) - 1)
    slots = {key: slot for slot, key in enumerate(key[: len(genes)].tolist())}
    if len(slots) < len(genes):
        raise _wrong("two nodes have the same key")
    if list(slots)[: network.inputs] != list(range(network.inputs)):
        raise _wrong(f"its first nodes are not the inputs, 0 to {network.inputs - 1}")
    if not slots.keys() >= set(range(network.inputs, network.inputs + network.outputs)):
        raise _wrong(f"an output is missing, of {network.inputs} to {network.inputs + network.outputs - 1}")
    return Nodes(*map(jnp.asarray, (key, bias, response, activation))), slots


def _connections(genes: list[Any], capacity: int, slots: dict[int, int], network: GraphNetwork) -> Connections:
    """Check and lay out connection genes, which lead from earlier nodes to later ones."""
    source, target = np.zeros((2, capacity), np.int32)
    weight = np.zeros(capacity, np.float32)
    seen = set()
    for place, gene in enumerate(genes):
        fields = _fields(gene, {"source", "target", "weight"}, f"connection {place + 1}")
        ends = tuple(_whole(fields[name], f"a connection's {name}", 0, 2**31 - 1) for name in ("source", "target"))
        if not slots.keys() >= set(ends):
            raise _wrong(f"a connection leads from {ends[0]} to {ends[1]}, and one of them is no node")
        source[place], target[place] = (slots[key] for key in ends)
        if source[place] >= target[place] or target[place] < network.inputs:
            raise _wrong(f"a connection leads from {ends[0]} to {ends[1]}, against the order of the nodes")
        if ends in seen:
            raise _wrong(f"there are two connections from {ends[0]} to {ends[1]}")
        seen.add(ends)
        weight[place] = _single(fields["weight"], "a weight")
    return Connections(*map(jnp.asarray, (source, target, weight)))


def _loaded(text: str) -> dict[str, Any]:
    """Return the JSON object in `text`, which names its format and has all fields."""
    try:
        plain = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise _wrong("it is not one whole JSON text") from error
    if not isinstance(plain, dict) or plain.get("format") != FORMAT:
        raise _wrong(f'it does not say "format": "{FORMAT}"')
    known = {"format", "inputs", "outputs", "activations", "output", "capacity", "nodes", "connections"}
    return _fields(plain, known, "it")


def _fields(value: Any, known: set[str], what: str) -> dict[str, Any]:
    """Return a JSON object that has exactly the known fields."""
    if not isinstance(value, dict) or value.keys() != known:
        raise _wrong(f"{what} does not have the fields {', '.join(sorted(known))} and no others")
    return value


def _whole(value: Any, what: str, least: int, most: int) -> int:
    """Return a whole number in a range."""
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise _wrong(f"{what} is not a whole number from {least} to {most}")
    return value


def _single(value: Any, what: str) -> np.float32:
    """Return the nearest float32, which for a number that `to_json` has written is the same."""
    number = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}.get(value) if isinstance(value, str) else value
    if isinstance(number, bool) or not isinstance(number, int | float):
        raise _wrong(f"{what} is not a number")
    if not isinstance(value, str) and not abs(number) <= float(np.finfo(np.float32).max):
        raise _wrong(f"{what} does not fit into 32 bits")
    return np.float32(number)


def _wrong(reason: str) -> UserError:
    """Return the error of a text that is no genome."""
    return UserError(f"This is not a genome as evoclaims writes it: {reason}.")
