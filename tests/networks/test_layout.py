"""Where nodes lie, and which are at work."""

from __future__ import annotations

from typing import Any

import networkx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn

from evoclaims.networks.picture import at_work, columns, positions, substrate_graph
from evoclaims.networks.substrate import Substrate


def _graph(edges: list[tuple[int, int]], inputs: int = 2, outputs: int = 1, hidden: tuple[int, ...] = ()) -> Any:
    graph = networkx.DiGraph()
    for key in range(inputs + outputs):
        graph.add_node(key, kind="input" if key < inputs else "output")
    graph.add_nodes_from(hidden, kind="hidden")
    graph.add_edges_from(edges, weight=1.0)
    return graph


@st.composite
def graphs(draw: DrawFn) -> Any:
    """Draw a network of 2 inputs, 2 outputs and up to 8 hidden nodes, with connections along any order of them."""
    hidden = tuple(range(4, 4 + draw(st.integers(0, 8))))
    order = [0, 1, *draw(st.permutations((2, 3, *hidden)))]
    pairs = [(s, t) for i, s in enumerate(order) for t in order[max(i + 1, 2) :]]
    return _graph(draw(st.lists(st.sampled_from(pairs), unique=True)), 2, 2, hidden)


def test_only_what_lies_between_inputs_and_outputs_is_at_work() -> None:
    # 3 has no input, 4 leads nowhere, 5 is between; input 1 feeds only 4.
    graph = _graph([(3, 2), (0, 4), (1, 4), (0, 5), (5, 2)], hidden=(3, 4, 5))
    assert at_work(graph) == {0, 5, 2}


def test_an_output_that_nothing_feeds_is_not_at_work() -> None:
    assert at_work(_graph([(0, 2)], outputs=2)) == {0, 2}


@given(graphs())
def test_at_work_are_the_nodes_of_all_paths_from_inputs_to_outputs(graph: Any) -> None:
    paths = [path for s in (0, 1) for t in (2, 3) for path in networkx.all_simple_paths(graph, s, t)]
    assert at_work(graph) == {node for path in paths for node in path}


@given(graphs())
def test_a_node_lies_as_deep_as_its_longest_path_and_outputs_beyond_all(graph: Any) -> None:
    depth = columns(graph)
    assert depth.keys() == set(graph)
    assert {depth[0], depth[1]} == {0}
    inner = [node for node in graph if node not in (2, 3)]
    assert depth[2] == depth[3] == max(depth[node] for node in inner) + 1
    for source, target in graph.edges:
        assert source in (2, 3) or depth[source] < depth[target]
    for node in inner[2:]:
        # Paths from an input, and from any other node, which lies in the first column at the least.
        paths = [path for start in graph for path in networkx.all_simple_paths(graph, start, node)]
        assert depth[node] == max((len(path) - (path[0] in (0, 1)) for path in paths), default=1)


@settings(max_examples=50)
@given(graphs())
def test_places_are_the_columns_and_no_two_nodes_share_one(graph: Any) -> None:
    places, depth = positions(graph), columns(graph)
    assert {node: x for node, (x, _) in places.items()} == depth
    assert len({(x, round(y, 2)) for x, y in places.values()}) == len(places)
    for first, second in ((0, 1), (2, 3)):
        assert places[first][1] > places[second][1]


def test_a_long_chain_does_not_lie_on_one_line() -> None:
    chain = [(0, 3), *((i, i + 1) for i in range(3, 20)), (20, 2)]
    places = positions(_graph([*chain, *((0, i) for i in range(4, 21))], hidden=tuple(range(3, 21))))
    heights = [places[i][1] for i in range(3, 21)]
    assert np.ptp(heights) > 3
    assert places == positions(_graph([*chain, *((0, i) for i in range(4, 21))], hidden=tuple(range(3, 21))))


def test_a_substrates_network_has_its_neurons_at_their_places_and_the_drawn_connections() -> None:
    substrate = Substrate((((-1.0, 0.0), (1.0, 0.0)), ((0.5, 1.0),), ((0.0, 2.0),)))
    graph, places = substrate_graph(substrate, [np.array([[0.0, -2.0]], np.float32), np.array([[3.0]], np.float32)])
    assert places == {(0, 0): (-1, 0), (0, 1): (1, 0), (1, 0): (0.5, 1), (2, 0): (0, 2)}
    assert dict(graph.nodes(data="kind")) == {(0, 0): "input", (0, 1): "input", (1, 0): "hidden", (2, 0): "output"}
    assert dict(graph.edges) == {((0, 1), (1, 0)): {"weight": -2.0}, ((1, 0), (2, 0)): {"weight": 3.0}}
    assert at_work(graph) == {(0, 1), (1, 0), (2, 0)}


def test_a_network_without_connections_has_places_too() -> None:
    assert len(positions(_graph([]))) == 3
    assert positions(_graph([], inputs=1))[0] == pytest.approx((0.0, 0.0))
