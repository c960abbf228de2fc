"""Pictures of networks, drawn by matplotlib without a display; the same network gives the same bytes."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.drawing import Format, optional, own_style, saved
from evoclaims.networks.graph import GraphNetwork
from evoclaims.networks.layout import at_work, positions, substrate_graph
from evoclaims.networks.substrate import Point, Substrate

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
