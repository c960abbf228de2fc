"""Genomes written by hand, drawn at random, read back, and checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn
from reference import Genes, Node

from evoclaims.networks.genome import EMPTY, Connections, Genome, Nodes

NODES, CONNECTIONS = 10, 24
"""Capacity of genomes made by hand, the same for all so that each function is compiled once."""


def made(
    order: Sequence[int],
    weights: Mapping[tuple[int, int], float],
    nodes: Mapping[int, Node] | None = None,
    capacity: tuple[int, int] = (NODES, CONNECTIONS),
) -> Genome:
    """Return the genome with these node keys in this order, and these weights by the keys of both ends."""
    genes = {key: (nodes or {}).get(key, Node()) for key in order}
    slot = {key: i for i, key in enumerate(order)}

    def padded(values: Sequence[Any], size: int, dtype: type, empty: int = 0) -> Any:
        return np.array([*values, *[empty] * (size - len(values))], dtype)

    return Genome(
        nodes=Nodes(
            key=padded(order, capacity[0], np.int32, EMPTY),
            bias=padded([gene.bias for gene in genes.values()], capacity[0], np.float32),
            response=padded([gene.response for gene in genes.values()], capacity[0], np.float32),
            activation=padded([gene.activation for gene in genes.values()], capacity[0], np.int32),
        ),
        connections=Connections(
            source=padded([slot[source] for source, _ in weights], capacity[1], np.int32),
            target=padded([slot[target] for _, target in weights], capacity[1], np.int32),
            weight=padded(list(weights.values()), capacity[1], np.float32),
        ),
        node_count=np.int32(len(order)),
        connection_count=np.int32(len(weights)),
    )


def stacked(genomes: Sequence[Genome]) -> Genome:
    """Return a population of these genomes."""
    return jax.tree.map(lambda *leaf: np.stack(leaf), *genomes)


def at(genomes: Any, place: Any) -> Any:
    """Return the part at `place` of every leaf."""
    return jax.tree.map(lambda leaf: leaf[place], genomes)


def read(genome: Genome) -> Genes:
    """Return one genome's genes."""
    nodes, connections = genome.nodes, genome.connections
    n, c = int(genome.node_count), int(genome.connection_count)
    key = np.asarray(nodes.key).tolist()
    columns = [np.asarray(leaf)[:n].tolist() for leaf in (nodes.bias, nodes.response, nodes.activation)]
    ends = zip(np.asarray(connections.source)[:c].tolist(), np.asarray(connections.target)[:c].tolist(), strict=True)
    weights = np.asarray(connections.weight)[:c].tolist()
    return Genes(
        nodes={one: Node(*each) for one, *each in zip(key[:n], *columns, strict=True)},
        connections={(key[s], key[t]): weight for (s, t), weight in zip(ends, weights, strict=True)},
    )


def read_all(genomes: Genome) -> list[Genes]:
    """Return the genes of each genome of a population."""
    host = jax.device_get(genomes)
    return [read(at(host, i)) for i in range(len(host.node_count))]


def same(one: Any, other: Any) -> bool:
    """Whether two trees hold the same bits."""
    pairs = zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    return all(np.asarray(a).tobytes() == np.asarray(b).tobytes() for a, b in pairs)


def check(genomes: Genome, inputs: int, outputs: int, bound: float = 5.0, activations: int = 1) -> None:
    """Assert that genomes, leaves [any, …], are what the documentation of `Genome` promises."""
    g: Genome = jax.tree.map(lambda leaf: np.asarray(leaf).reshape(-1, *leaf.shape[genomes.node_count.ndim :]), genomes)
    n, c = g.nodes.key.shape[1], g.connections.weight.shape[1]
    has_node, has_connection = np.arange(n) < g.node_count[:, None], np.arange(c) < g.connection_count[:, None]
    assert (g.node_count >= inputs + outputs).all()
    assert (g.node_count <= n).all()
    assert (g.connection_count >= 0).all()
    assert (g.connection_count <= c).all()
    # Packed: nothing is left beyond the counts, and every gene within them is one.
    assert ((g.nodes.key >= 0) == has_node).all()
    assert (np.where(has_node, EMPTY, g.nodes.key) == EMPTY).all()
    for leaf in (g.nodes.bias, g.nodes.response, g.nodes.activation):
        assert (leaf[~has_node] == 0).all()
    for leaf in jax.tree.leaves(g.connections):
        assert (leaf[~has_connection] == 0).all()
    # Inputs lie first, outputs are there, and no key is there twice.
    assert (g.nodes.key[:, :inputs] == np.arange(inputs)).all()
    for output in range(inputs, inputs + outputs):
        assert (np.sum(g.nodes.key == output, axis=1) == 1).all()
    ordered = np.sort(np.where(has_node, g.nodes.key, np.iinfo(np.int32).max - np.arange(n)), axis=1)
    assert (np.diff(ordered, axis=1) != 0).all()
    # Topological, none into an input, no connection twice.
    source, target = g.connections.source, g.connections.target
    assert (source < target)[has_connection].all()
    assert (source >= 0)[has_connection].all()
    assert (target < g.node_count[:, None])[has_connection].all()
    assert (target >= inputs)[has_connection].all()
    ends = np.sort(np.where(has_connection, source * n + target, -1 - np.arange(c)), axis=1)
    assert (np.diff(ends, axis=1) != 0).all()
    for leaf in (g.nodes.bias, g.nodes.response, g.connections.weight):
        assert np.isfinite(leaf).all()
        assert (np.abs(leaf) <= bound).all()
    assert (g.nodes.activation >= 0).all()
    assert (g.nodes.activation < activations).all()


# Thirty-seconds are exact in float32, and so are their sums.
numbers = st.integers(-160, 160).map(lambda n: n / 32)


@st.composite
def dags(draw: DrawFn, inputs: int = 2, outputs: int = 2, hidden: int = NODES - 4, activations: int = 1) -> Genome:
    """Draw a genome with any topological order and any connections along it, full ones among them."""
    keys = list(range(inputs + outputs))
    count = draw(st.integers(0, hidden))
    keys += draw(st.lists(st.integers(inputs + outputs, 40), min_size=count, max_size=count, unique=True))
    order = [*keys[:inputs], *draw(st.permutations(keys[inputs:]))]
    pairs = [(s, t) for i, s in enumerate(order) for t in order[max(i + 1, inputs) :]]
    ends = draw(st.permutations(pairs))[: draw(st.integers(0, min(len(pairs), CONNECTIONS)))]
    nodes = {key: Node(draw(numbers), draw(numbers), draw(st.integers(0, activations - 1))) for key in order}
    return made(order, {pair: draw(numbers) for pair in ends}, nodes)
