"""Genomes for other programs: as plain JSON that loses no bit."""

from __future__ import annotations

import json
from typing import Any, Final

import jax

from evoclaims.core.canonical import as_plain
from evoclaims.networks.genome import Genome
from evoclaims.networks.graph import GraphNetwork

FORMAT: Final = "evoclaims genome 1"


def genome_json(genome: Genome, network: GraphNetwork) -> str:
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
