"""Pictures of networks, drawn by matplotlib without a display; the same network gives the same bytes.

Graphs are `networkx.DiGraph`s without cycles, whose nodes have a `kind` ("input", "output", "hidden"). networkx's own
column layouts hide nodes behind passing connections, and its spring layouts have no columns.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.drawing import Format, optional, own_style, saved
from evoclaims.networks.graph import GraphNetwork
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


KINDS: Final = {"input": "#7fb3d5", "hidden": "#ffffff", "output": "#f5b041"}
POSITIVE, NEGATIVE, INK, PALE = "#2166ac", "#b2182b", "#333333", 0.22
"""Colours safe for red-green colour blindness; `PALE` is the opacity of inactive nodes and connections."""


@dataclass(frozen=True)
class Panel:
    """One network and the positions of its nodes.

    Attributes:
        graph: a `networkx.DiGraph` with `kind` on nodes and `weight` on edges.
        places: of all nodes.
        title: above the panel.
        inside: a word inside each node, such as its activation function.
        beside: names beside inputs and outputs.
        flowing: whether connections leave to the right and arrive from the left; else they are straight.
        size: width and height in inches.
    """

    graph: Any
    places: Mapping[Hashable, Point]
    title: str
    inside: Mapping[Hashable, str] = field(default_factory=dict)
    beside: Mapping[Hashable, str] = field(default_factory=dict)
    flowing: bool = True
    size: tuple[float, float] = (6.0, 5.0)


def network_panel(
    graph: Any, network: GraphNetwork, title: str, inputs: Sequence[str] = (), outputs: Sequence[str] = ()
) -> Panel:
    """Lay out a genome's network, columns by the longest path from an input.

    Args:
        graph: what `export.to_networkx` returns.
        network: its description; hidden nodes are labelled if several functions are possible.
        title: what to write above it, before the counts.
        inputs: their names; "x0", "x1", … by default.
        outputs: their names; "y0", "y1", … by default.
    """
    names = [*(inputs or _numbered("x", network.inputs)), *(outputs or _numbered("y", network.outputs))]
    hidden = [key for key, kind in graph.nodes(data="kind") if kind == "hidden"]
    several = len(set(network.activations)) > 1
    places = positions(graph)
    across, down = np.ptp(np.array(list(places.values())), axis=0).tolist()
    # Inches per column: wide if there are few, narrow for long chains.
    unit = min(max(15.0 / across, 0.36), 0.9)
    width = max(1.5 + unit * across, 5.0)
    return Panel(
        graph=graph,
        places=places,
        title=f"{title}\n{_counts(graph)}",
        inside={key: graph.nodes[key]["activation"] for key in hidden} if several else {},
        beside=dict(enumerate(names)),
        size=(width, 1.2 + max(min(unit * down, 0.6 * width), 0.3 * down, 2.5)),
    )


def substrate_panel(substrate: Substrate, weights: Sequence[NDArray[Any]], title: str) -> Panel:
    """Show the network that a CPPN made: neurons at their coordinates, and its connections (see `substrate_graph`)."""
    graph, places = substrate_graph(substrate, weights)
    last = len(substrate.layers[0]) - 1
    outputs = _numbered("y", len(substrate.layers[-1]))
    names: dict[Hashable, str] = {(0, i): name for i, name in enumerate([*_numbered("x", last), "bias"])}
    names |= {(len(substrate.layers) - 1, i): name for i, name in enumerate(outputs)}
    widest = max(map(len, substrate.layers))
    size = (max(6.0, 0.45 * widest), 5.0)
    return Panel(graph, places, f"{title}\n{_counts(graph)}", beside=names, flowing=False, size=size)


def draw(panels: Sequence[Panel], title: str, file_format: Format) -> bytes:
    """Draw panels side by side, with one legend; return the file's contents.

    Colour shows a weight's sign, and width its size relative to the panel's largest.

    Raises:
        UserError: for another format, or when matplotlib is not installed.
    """
    with own_style():
        width, height = sum(panel.size[0] for panel in panels), max(panel.size[1] for panel in panels)
        figure = optional("matplotlib.figure").Figure(figsize=(width, height + 1.0), dpi=130, layout="constrained")
        axes = figure.subplots(1, len(panels), squeeze=False, width_ratios=[panel.size[0] for panel in panels])[0]
        for axis, panel in zip(axes, panels, strict=True):
            _paint(axis, panel)
        figure.suptitle(title, fontsize=12)
        _legend(figure, width)
        return saved(figure, file_format)


def _numbered(letter: str, count: int) -> list[str]:
    """Return "x0", "x1", …."""
    return [f"{letter}{i}" for i in range(count)]


def _counts(graph: Any) -> str:
    """Say how large a network is, and how much of it is active."""
    working = at_work(graph)
    used = sum(source in working and target in working for source, target in graph.edges)
    hidden = [node for node, kind in graph.nodes(data="kind") if kind == "hidden"]
    return (
        f"{len(hidden)} hidden nodes ({sum(node in working for node in hidden)} at work), "
        f"{graph.number_of_edges()} connections ({used} at work)"
    )


def _paint(axis: Any, panel: Panel) -> None:
    """Paint one panel: connections below, nodes above, words on top."""
    working = at_work(panel.graph)
    _paint_connections(axis, panel, working)
    for kind, colour in KINDS.items():
        area = 460 if kind == "hidden" and panel.inside else 110
        for is_working, opacity in ((True, 1.0), (False, PALE)):
            nodes = [n for n, k in panel.graph.nodes(data="kind") if k == kind and (n in working) == is_working]
            if nodes:
                across, up = zip(*(panel.places[node] for node in nodes), strict=True)
                # An opaque disc hides the connections behind a pale node.
                axis.scatter(across, up, s=area, c="white", edgecolors="none", zorder=2)
                axis.scatter(across, up, s=area, c=colour, edgecolors=INK, linewidths=0.9, alpha=opacity, zorder=3)
    kinds = dict(panel.graph.nodes(data="kind"))
    for node, (x, y) in panel.places.items():
        style = {"ha": "center", "va": "center", "alpha": 1.0 if node in working else 2 * PALE, "zorder": 4}
        if node in panel.inside:
            axis.text(x, y, panel.inside[node], fontsize=5.5, **style)
        if node in panel.beside:
            sign = -1.0 if kinds[node] == "input" else 1.0  # out of the network
            axis.annotate(
                panel.beside[node],
                (x, y),
                xytext=(17.0 * sign, 0.0) if panel.flowing else (0.0, 15.0 * sign),
                textcoords="offset points",
                fontsize=8,
                **style,
            )
    axis.set_title(panel.title, fontsize=9)
    axis.margins(0.08, 0.08)
    axis.set_axis_off()


def _paint_connections(axis: Any, panel: Panel, working: set[Hashable]) -> None:
    """Paint all connections, the pale ones first."""
    collections, paths = optional("matplotlib.collections"), optional("matplotlib.path")
    edges = list(panel.graph.edges(data="weight"))
    largest = max((abs(weight) for _, _, weight in edges), default=1.0) or 1.0
    widest = min(max(20.0 / math.sqrt(max(len(edges), 1)), 0.8), 2.6)
    for is_working in (False, True):
        chosen = [edge for edge in edges if (edge[0] in working and edge[1] in working) == is_working]
        bends = [_bend(panel.places[source], panel.places[target], panel.flowing) for source, target, _ in chosen]
        axis.add_collection(
            collections.PathCollection(
                [paths.Path(bend, [1, 4, 4, 4]) for bend in bends],
                facecolors="none",
                edgecolors=[POSITIVE if weight > 0 else NEGATIVE for *_, weight in chosen],
                linewidths=[0.3 + widest * abs(weight) / largest for *_, weight in chosen],
                alpha=0.7 if is_working else PALE,
                zorder=1,
            )
        )


def _bend(source: Point, target: Point, flowing: bool) -> NDArray[np.float64]:
    """Return the four points of a cubic Bézier curve."""
    start, end = np.array(source), np.array(target)
    reach = (end - start) / 3
    if flowing:
        # A curve going back still leaves to the right, to show its direction.
        forward = end[0] - start[0]
        reach = np.array([0.4 * forward if forward > 0 else 1.0, 0.0])
    return np.array([start, start + reach, end - reach, end])


def _legend(figure: Any, width: float) -> None:
    """Explain the colours below the panels."""
    lines = optional("matplotlib.lines")
    nodes = [
        lines.Line2D([], [], marker="o", linestyle="", markersize=8, markerfacecolor=c, markeredgecolor=INK, label=k)
        for k, c in KINDS.items()
    ]
    weights = [
        lines.Line2D([], [], color=colour, linewidth=2, label=f"{word} weight (width: size)")
        for colour, word in ((POSITIVE, "positive"), (NEGATIVE, "negative"))
    ]
    pale = lines.Line2D([], [], color=INK, alpha=PALE, linewidth=2, label="pale: on no path from an input to an output")
    figure.legend(
        handles=[*nodes, *weights, pale],
        loc="outside lower center",
        ncols=6 if width > 10 else 3,
        fontsize=8,
        frameon=False,
    )
