"""Pictures of networks, read back from the SVG: what is drawn, how, and that it depends on nothing else."""

from __future__ import annotations

import re
import struct
import sys
from collections import Counter
from typing import Any
from xml.etree import ElementTree

import matplotlib as mpl
import networkx
import numpy as np
import pytest

from evoclaims.core.errors import UserError
from evoclaims.networks.graph import GraphNetwork
from evoclaims.networks.picture import NEGATIVE, PALE, POSITIVE, Panel, draw, network_panel, substrate_panel
from evoclaims.networks.substrate import layered

SEVERAL = GraphNetwork(2, 1, ("tanh", "sin"))


def _graph(functions: dict[int, str], edges: dict[tuple[int, int], float], network: GraphNetwork = SEVERAL) -> Any:
    graph = networkx.DiGraph()
    for key in range(network.inputs + network.outputs):
        graph.add_node(key, kind="input" if key < network.inputs else "output", activation="tanh")
    for key, function in functions.items():
        graph.add_node(key, kind="hidden", activation=function)
    graph.add_weighted_edges_from((source, target, weight) for (source, target), weight in edges.items())
    return graph


# Node 3 is at work; 4 is fed and leads nowhere.
SMALL = _graph({3: "sin", 4: "tanh"}, {(0, 3): 2.0, (3, 2): -1.0, (0, 4): 0.5})


def _svg(*panels: Panel, title: str = "a title") -> ElementTree.Element:
    return ElementTree.fromstring(draw(panels, title, "svg"))


def _words(svg: ElementTree.Element) -> Counter[str]:
    return Counter("".join(text.itertext()) for text in svg.iter("{http://www.w3.org/2000/svg}text"))


def _curves(svg: ElementTree.Element) -> list[tuple[str, float, float]]:
    """Return colour, opacity and width of every Bézier curve without a filling."""
    found = []
    for path in svg.iter("{http://www.w3.org/2000/svg}path"):
        style = dict(re.findall(r"([a-z-]+): ?([^;]+)", path.get("style", "")))
        if style.get("fill") == "none" and " C " in f" {path.get('d', '')} ".replace("\n", " "):
            width = float(style.get("stroke-width", 1))
            found.append((style["stroke"], float(style.get("stroke-opacity", 1)), width))
    return found


def test_a_connections_colour_is_its_sign_its_width_its_size_and_pale_is_idle() -> None:
    curves = _curves(_svg(network_panel(SMALL, SEVERAL, "a network")))
    pale, (positive, strong, wide), (negative, _, narrow) = curves
    assert (positive, negative) == (POSITIVE, NEGATIVE)
    assert narrow == pytest.approx(0.3 + (wide - 0.3) / 2, abs=1e-3)
    assert pale == (POSITIVE, PALE, pytest.approx(0.3 + (wide - 0.3) / 4, abs=1e-3))
    assert strong > 2 * PALE


def test_a_picture_says_what_it_shows() -> None:
    words = _words(_svg(network_panel(SMALL, SEVERAL, "a network"), title="neat on a task"))
    assert words["neat on a task"] == 1
    assert words["2 hidden nodes (1 at work), 3 connections (2 at work)"] == 1
    for word in ("x0", "x1", "y0", "input", "hidden", "output", "sin", "tanh"):
        assert words[word] == 1, word
    assert any("no path from an input to an output" in word for word in words)


def test_functions_are_written_only_where_several_are_possible() -> None:
    one = GraphNetwork(2, 1, ("sin", "sin"))
    words = _words(_svg(network_panel(SMALL, one, "a network")))
    assert words["sin"] == words["tanh"] == 0
    same = _graph({3: "sin"}, {(0, 3): 1.0, (3, 2): 1.0})
    assert _words(_svg(network_panel(same, SEVERAL, "a network")))["sin"] == 1


def test_inputs_and_outputs_can_be_given_names_one_for_each() -> None:
    words = _words(_svg(network_panel(SMALL, SEVERAL, "a network", ("left", "right"), ("q",))))
    assert (words["left"], words["right"], words["q"], words["x0"], words["y0"]) == (1, 1, 1, 0, 0)


def test_the_substrates_network_has_its_bias_named_and_its_drawn_connections() -> None:
    weights = [np.array([[1.0, 0.0, -1.0], [0.0, 0.0, 0.0]]), np.array([[0.5, 0.5]])]
    svg = _svg(network_panel(SMALL, SEVERAL, "the CPPN"), substrate_panel(layered((3, 2, 1)), weights, "it draws"))
    words = _words(svg)
    assert words["2 hidden nodes (1 at work), 4 connections (3 at work)"] == 1
    assert (words["x0"], words["x1"], words["bias"], words["y0"]) == (2, 2, 1, 2)
    assert len(_curves(svg)) == 3 + 4


@pytest.mark.parametrize("file_format", ["svg", "png"])
def test_the_same_network_gives_the_same_bytes_whatever_style_the_user_has_set(
    file_format: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    panels = [network_panel(SMALL, SEVERAL, "a network")]
    first = draw(panels, "a title", file_format)
    with mpl.rc_context({"font.size": 30, "svg.hashsalt": None, "lines.linewidth": 9, "figure.facecolor": "black"}):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", "1")
        assert draw(panels, "a title", file_format) == first
        assert mpl.rcParams["font.size"] == 30


def test_a_png_is_as_large_as_its_panels() -> None:
    panel = network_panel(SMALL, SEVERAL, "a network")
    data = draw([panel, panel], "a title", "png")
    assert data.startswith(b"\x89PNG")
    width, height = struct.unpack(">II", data[16:24])
    assert (width, height) == (int(260 * panel.size[0]), int(130 * (panel.size[1] + 1)))


def test_a_network_of_a_hundred_nodes_fits_a_screen_and_its_nodes_stay_apart() -> None:
    rng = np.random.default_rng(0)
    network = GraphNetwork(6, 2)
    order = [*range(6), *rng.permutation(np.arange(6, 100)).tolist()]
    pairs = [(s, t) for i, s in enumerate(order) for t in order[max(6, i + 1) : i + 12]]
    chosen = [pairs[i] for i in rng.choice(len(pairs), 400, replace=False)]
    panel = network_panel(
        _graph(dict.fromkeys(range(8, 100), "tanh"), {ends: rng.normal() for ends in chosen}, network), network, "large"
    )
    assert len(_curves(_svg(panel))) == 400
    assert max(panel.size) <= 40
    places = np.array(list(panel.places.values()))
    inches = places * (np.array(panel.size) - [1.5, 1.2]) / np.ptp(places, axis=0)
    apart = np.hypot(*(inches[:, None] - inches[None, :]).T)
    np.fill_diagonal(apart, np.inf)
    # Discs of 110 points² are 0.16 inches wide.
    assert np.mean(apart.min(axis=1) > 0.16) > 0.95


@pytest.mark.parametrize("edges", [{}, {(0, 3): 0.0, (3, 2): 0.0}])
def test_a_network_without_connections_or_with_weights_of_0_is_drawn(edges: dict[tuple[int, int], float]) -> None:
    assert len(_curves(_svg(network_panel(_graph({3: "sin"}, edges), SEVERAL, "a network")))) == len(edges)


def test_another_format_is_told_with_the_known_ones() -> None:
    with pytest.raises(UserError, match="no format of a picture named 'svgg'. Did you mean 'svg'"):
        draw([network_panel(SMALL, SEVERAL, "a network")], "a title", "svgg")  # type: ignore[arg-type]


def test_a_picture_without_matplotlib_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    panel = network_panel(SMALL, SEVERAL, "a network")
    monkeypatch.setitem(sys.modules, "matplotlib.style", None)
    with pytest.raises(UserError, match=r'matplotlib is not installed.*pip install "evoclaims\[pictures\]"'):
        draw([panel], "a title", "svg")
