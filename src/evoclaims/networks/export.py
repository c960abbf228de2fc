"""Genomes for other programs: as a directed graph of networkx, and as plain JSON that loses no bit."""

from __future__ import annotations

import json
from typing import Any, Final

import jax

from evoclaims.core.canonical import as_plain
from evoclaims.core.drawing import optional
from evoclaims.networks.genome import Genome
from evoclaims.networks.graph import GraphNetwork

FORMAT: Final = "evoclaims genome 1"


def to_networkx(genome: Genome, network: GraphNetwork) -> Any:
    """Return one genome's network as a `networkx.DiGraph`.

    Nodes, in topological order, are historical markings. Their attributes are `kind` ("input", "output", "hidden"),
    `bias`, `response` and `activation`, the name of the function applied: for an input "identity", for an output the
    network's output function, whose argument other nodes see (see `networks.graph`). Edges have a `weight`.

    Raises:
        UserError: when networkx is not installed.
    """
    graph = optional("networkx").DiGraph()
    nodes, connections = _genes(genome)
    fixed = {"input": "identity", "output": network.output}
    ends = ["input"] * network.inputs + ["output"] * network.outputs  # by key
    for node in nodes:
        kind = ends[node["key"]] if node["key"] < len(ends) else "hidden"
        function = fixed.get(kind, network.activations[node["activation"]])
        graph.add_node(node["key"], kind=kind, bias=node["bias"], response=node["response"], activation=function)
    for connection in connections:
        graph.add_edge(connection["source"], connection["target"], weight=connection["weight"])
    return graph


def to_json(genome: Genome, network: GraphNetwork) -> str:
    """Return one genome as JSON, one gene per line.

    Genes are in slot order. A node's `activation` indexes `activations`; connections name the keys of both ends;
    numbers are written so that the same float32 is read back, and non-finite ones as "nan", "inf", "-inf".
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
