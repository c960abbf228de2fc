"""Where the nodes of a network lie in a picture, and which of them are active.

Graphs are `networkx.DiGraph`s without cycles, whose nodes have a `kind` ("input", "output", "hidden"). networkx's own
column layouts hide nodes behind passing connections, and its spring layouts have no columns.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.drawing import optional
from evoclaims.networks.substrate import Point, Substrate

ROUNDS: Final = 300
NEAR: Final = 1.0
"""Distance of nodes from each other and from passing connections, in column widths."""


def at_work(graph: Any) -> set[Hashable]:
    """Return the nodes on a path from an input to an output: no other node can change what the network does."""
    networkx = optional("networkx")
    kinds = graph.nodes(data="kind")

    def reached(kind: str, direction: Any) -> set[Hashable]:
        ends = [node for node, its_kind in kinds if its_kind == kind]
        return set(ends).union(*(direction(graph, end) for end in ends))

    return reached("input", networkx.descendants) & reached("output", networkx.ancestors)


def columns(graph: Any) -> dict[Hashable, int]:
    """Return each node's depth, the length of the longest path to it; all outputs lie beyond the deepest other node."""
    networkx = optional("networkx")
    depth: dict[Hashable, int] = {}
    for node in networkx.topological_sort(graph):
        least = 0 if graph.nodes[node]["kind"] == "input" else 1
        depth[node] = max((depth[source] + 1 for source in graph.predecessors(node)), default=least)
    outputs = [node for node, kind in graph.nodes(data="kind") if kind == "output"]
    last = max((depth[node] for node in graph if node not in outputs), default=0) + 1
    return {**depth, **dict.fromkeys(outputs, last)}


def positions(graph: Any) -> dict[Hashable, Point]:
    """Return a place for each node: its column as x, and a y that puts connected nodes at about the same height.

    Inputs and outputs are spread evenly from top to bottom in key order. The others are pulled to their neighbours'
    mean height and pushed away from other nodes and from passing connections.
    """
    depth = columns(graph)
    nodes = sorted(graph, key=lambda node: (depth[node], node))
    index = {node: i for i, node in enumerate(nodes)}
    kinds = [graph.nodes[node]["kind"] for node in nodes]
    x = np.array([depth[node] for node in nodes], float)
    widest = int(np.max(np.bincount(x.astype(int))))
    height = NEAR * max(widest, 0.6 * x.max(), 3)
    y = np.zeros(len(nodes))
    for kind in ("input", "output"):
        these = [i for i, its_kind in enumerate(kinds) if its_kind == kind]
        y[these] = height * (0.5 - (np.arange(len(these)) + 0.5) / max(len(these), 1))
    hidden = np.array([kind == "hidden" for kind in kinds])
    ends = np.array([(index[source], index[target]) for source, target in graph.edges], int).reshape(-1, 2)
    linked = optional("networkx").to_numpy_array(graph.to_undirected(as_view=True), nodes, weight=None)
    # The distance between nodes if they shared the area evenly.
    apart = max(1.2 * math.sqrt(x.max() * height / len(nodes)), 1.5 * NEAR)
    # Multiples of the golden ratio: any number of nodes in a column start apart.
    y[hidden] = height * (np.arange(hidden.sum()) * 0.618034 % 1.0 - 0.5)
    for i in range(ROUNDS):
        pull = linked @ y / np.maximum(linked.sum(axis=1), 1) - y
        push = _off_nodes(x, y, apart) + _off_connections(x, y, ends)
        step = 0.3 * (1 - i / ROUNDS)
        y = np.where(hidden, np.clip(y + step * (0.3 * pull + push), -height / 2, height / 2), y)
    return {node: (float(x[i]), float(y[i])) for node, i in index.items()}


def substrate_graph(substrate: Substrate, weights: Sequence[NDArray[Any]]) -> tuple[Any, dict[Hashable, Point]]:
    """Return a substrate's network and its neurons' places.

    Nodes are (layer, place in the layer), with their `kind`. The weights are into each layer but the first, shapes
    [to, from]; 0 means no connection.
    """
    graph = optional("networkx").DiGraph()
    last = len(substrate.layers) - 1
    kinds: Mapping[int, str] = {0: "input", last: "output"}
    places: dict[Hashable, Point] = {}
    for layer, points in enumerate(substrate.layers):
        for place, point in enumerate(points):
            graph.add_node((layer, place), kind=kinds.get(layer, "hidden"))
            places[layer, place] = point
    for layer, matrix in enumerate(weights):
        for target, source in np.argwhere(np.asarray(matrix) != 0).tolist():
            graph.add_edge((layer, source), (layer + 1, target), weight=float(matrix[target, source]))
    return graph, places


def _off_nodes(x: NDArray[Any], y: NDArray[Any], apart: float) -> NDArray[Any]:
    """Return the push from other nodes, proportional to how much nearer than `apart` they are."""
    dx, dy = np.abs(x[:, None] - x[None, :]), y[:, None] - y[None, :]
    near = np.clip(apart - np.hypot(dx, dy), 0, None)
    np.fill_diagonal(near, 0)
    # Of two at the same place the later one goes down.
    above = np.where(dy == 0, np.sign(np.arange(len(y))[None, :] - np.arange(len(y))[:, None]), np.sign(dy))
    pushed: NDArray[Any] = np.sum(near * above, axis=1)
    return pushed


def _off_connections(x: NDArray[Any], y: NDArray[Any], ends: NDArray[Any]) -> NDArray[Any]:
    """Return the push from connections that pass a node's column near its height."""
    source, target = ends[:, 0], ends[:, 1]
    span = np.where(x[target] == x[source], 1.0, x[target] - x[source])
    share = (x[:, None] - x[source]) / span
    distance = y[:, None] - (y[source] + share * (y[target] - y[source]))
    passing = (share > 0) & (share < 1)
    near = np.clip(0.5 * NEAR - np.abs(distance), 0, None) * passing
    pushed: NDArray[Any] = np.clip(np.sum(near * np.where(distance >= 0, 1, -1), axis=1), -NEAR, NEAR)
    return pushed
