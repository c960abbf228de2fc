"""Where neurons lie, and which pairs of them are asked for, by hand and by properties."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.core.canonical import canonical_json
from evoclaims.core.errors import UserError
from evoclaims.networks.substrate import Extent, Substrate, layered, on_circle

extents = st.sampled_from(["largest_layer", "unit"])
layer_widths = st.lists(st.integers(1, 9), min_size=2, max_size=4)


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


def test_sensors_that_point_in_the_four_directions_lie_there() -> None:
    quarters = [0.0, math.pi / 2, math.pi, 3 * math.pi / 2]
    np.testing.assert_allclose(on_circle(quarters, 0.5), [(0.5, 0), (0, 0.5), (-0.5, 0), (0, -0.5)], atol=1e-12)
    np.testing.assert_allclose(on_circle(quarters), [(1, 0), (0, 1), (-1, 0), (0, -1)], atol=1e-12)


def test_a_substrate_is_told_apart_by_its_places_alone() -> None:
    one, same, other = layered((3, 2, 1)), layered([3, 2, 1], "largest_layer"), layered((3, 2, 1), "unit")
    assert (one, hash(one), canonical_json(one)) == (same, hash(same), canonical_json(same))
    assert one != other
    assert canonical_json(one) != canonical_json(other)


FIRST: tuple[tuple[float, float], ...] = ((0.0, 0.0),)


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        *((partial(layered, widths), "at least two layers") for widths in ((), (3,), (3, 0, 1), (3, -1))),
        (partial(layered, (3, 1), "half"), r"'half'.*largest_layer, unit"),
        *(
            (partial(Substrate, layers), "a layer of inputs and one of outputs, and no empty layer")
            for layers in ((), (FIRST,), (FIRST, ()), (FIRST, (), ((1.0, 1.0),)))
        ),
        *(
            (partial(Substrate, ((*FIRST, point), FIRST)), "two finite coordinates")
            for point in ((0.0,), (0.0, 1.0, 2.0), (math.nan, 0.0), (0.0, math.inf))
        ),
    ],
)
def test_what_is_no_substrate_is_one_sentence(build: Callable[[], Substrate], sentence: str) -> None:
    with pytest.raises(UserError, match=sentence):
        build()
