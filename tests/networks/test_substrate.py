"""Where neurons lie, and which pairs of them are asked for, by hand and by properties."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.core.canonical import canonical_json
from evoclaims.core.errors import UserError
from evoclaims.networks.substrate import Extent, Substrate, layered, on_circle

extents = st.sampled_from(["largest_layer", "unit"])
layer_widths = st.lists(st.integers(1, 9), min_size=2, max_size=4)


def test_a_layered_substrate_by_hand() -> None:
    inputs, hidden, outputs = layered((3, 2, 1), "unit").layers
    assert inputs == ((-1.0, -1.0), (0.0, -1.0), (1.0, -1.0))
    assert hidden == ((-1.0, 0.0), (1.0, 0.0))
    assert outputs == ((0.0, 1.0),)


def test_by_default_coordinates_run_to_the_width_of_the_largest_layer() -> None:
    inputs, hidden, outputs = layered((2, 5, 1)).layers
    assert inputs == ((-5.0, -5.0), (5.0, -5.0))
    assert hidden == ((-5.0, 0.0), (-2.5, 0.0), (0.0, 0.0), (2.5, 0.0), (5.0, 0.0))
    assert outputs == ((0.0, 5.0),)


@given(widths=layer_widths, extent=extents)
def test_layers_are_even_and_symmetric_and_reach_the_extent(widths: list[int], extent: Extent) -> None:
    substrate = layered(widths, extent)
    size = float(max(widths)) if extent == "largest_layer" else 1.0
    assert [len(layer) for layer in substrate.layers] == widths
    heights = [{y for _, y in layer} for layer in substrate.layers]
    assert all(len(its) == 1 for its in heights)
    rows = [np.array([y for its in heights for y in its])]
    rows += [np.array([x for x, _ in layer]) for layer in substrate.layers]
    for row in rows:
        np.testing.assert_allclose(row, -row[::-1], atol=1e-12)
        if len(row) > 1:
            assert (row[0], row[-1]) == (-size, size)
            np.testing.assert_allclose(np.diff(row), 2 * size / (len(row) - 1), rtol=1e-12)


def test_queries_are_the_places_of_source_and_target_in_the_order_of_the_weights() -> None:
    substrate = Substrate((((1.0, 2.0), (3.0, 4.0)), ((5.0, 6.0), (7.0, 8.0)), ((9.0, 10.0),)))
    assert substrate.shapes == [(2, 2), (1, 2)]
    assert substrate.queries.dtype == np.float32
    assert substrate.queries.tolist() == [
        [1, 2, 5, 6],
        [3, 4, 5, 6],
        [1, 2, 7, 8],
        [3, 4, 7, 8],
        [5, 6, 9, 10],
        [7, 8, 9, 10],
    ]


@given(widths=layer_widths, extent=extents)
def test_every_pair_of_neighbouring_layers_is_asked_for_once(widths: list[int], extent: Extent) -> None:
    substrate = layered(widths, extent)
    queries = substrate.queries
    assert queries.shape == (sum(to * fro for to, fro in substrate.shapes), 4)
    assert len(np.unique(queries, axis=0)) == len(queries)
    assert (queries[:, 1] < queries[:, 3]).all()


def test_sensors_that_point_in_the_four_directions_lie_there() -> None:
    quarters = [0.0, math.pi / 2, math.pi, 3 * math.pi / 2]
    np.testing.assert_allclose(on_circle(quarters, 0.5), [(0.5, 0), (0, 0.5), (-0.5, 0), (0, -0.5)], atol=1e-12)
    np.testing.assert_allclose(on_circle(quarters), [(1, 0), (0, 1), (-1, 0), (0, -1)], atol=1e-12)


def test_a_substrate_is_told_apart_by_its_places_alone() -> None:
    one, same, other = layered((3, 2, 1)), layered([3, 2, 1], "largest_layer"), layered((3, 2, 1), "unit")
    assert (one, hash(one), canonical_json(one)) == (same, hash(same), canonical_json(same))
    assert one != other
    assert canonical_json(one) != canonical_json(other)


@pytest.mark.parametrize("widths", [(), (3,), (3, 0, 1), (3, -1)])
def test_widths_that_are_no_network_are_one_sentence(widths: tuple[int, ...]) -> None:
    with pytest.raises(UserError, match="at least two layers of at least one neuron each"):
        layered(widths)


def test_an_unknown_extent_is_told_with_the_known_ones() -> None:
    with pytest.raises(UserError, match=r"'half'.*largest_layer, unit"):
        layered((3, 1), "half")  # type: ignore[arg-type]


@pytest.mark.parametrize("layers", [(), (((0.0, 0.0),),), (((0.0, 0.0),), ()), (((0.0, 0.0),), (), ((1.0, 1.0),))])
def test_neurons_placed_by_hand_need_two_layers_and_none_empty(layers: tuple[tuple[tuple[float, float], ...]]) -> None:
    with pytest.raises(UserError, match="a layer of inputs and one of outputs, and no empty layer"):
        Substrate(layers)


@pytest.mark.parametrize("point", [(0.0,), (0.0, 1.0, 2.0), (math.nan, 0.0), (0.0, math.inf)])
def test_a_place_that_is_no_point_of_the_plane_is_told(point: tuple[float, ...]) -> None:
    with pytest.raises(UserError, match=r"two finite coordinates"):
        Substrate((((0.0, 0.0), point), ((1.0, 1.0),)))  # type: ignore[arg-type]
