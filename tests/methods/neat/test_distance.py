"""The distance of two genomes against the equation in float64."""

from __future__ import annotations

import jax
import numpy as np
import pytest
import reference
from genomes import dags, made, read
from hypothesis import given, settings
from reference import Node

from evoclaims.methods.neat.homology import distance
from evoclaims.methods.neat.settings import Species
from evoclaims.networks.genome import Genome

pytestmark = pytest.mark.slow


_distance = jax.jit(lambda one, other: distance(Species(), one, other))
_weighted = jax.jit(lambda one, other: distance(Species(disjoint=2.5, difference=0.7), one, other))


@settings(max_examples=80, deadline=None)
@given(dags(activations=3), dags(activations=3))
def test_any_two_genomes_are_as_far_apart_as_in_float64(one: Genome, other: Genome) -> None:
    wanted = reference.distance(read(one), read(other))
    np.testing.assert_allclose(_distance(one, other), wanted, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(_distance(other, one), wanted, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(_weighted(one, other), reference.distance(read(one), read(other), 2.5, 0.7), rtol=1e-5)
    assert float(_distance(one, one)) == 0.0


def test_the_distance_of_two_small_genomes_is_the_one_worked_out_by_hand() -> None:
    one = made([0, 1, 2, 5, 3], {(0, 2): 1.0, (1, 2): 2.0, (0, 5): 1.0}, {2: Node(0.5, 1.0, 0), 5: Node(9.0)})
    other = made([0, 1, 2, 3], {(0, 2): -1.0, (1, 3): 1.0}, {2: Node(-0.5, 3.0, 1)})
    nodes = (1.0 * 1 + 0.4 * (1.0 + 2.0 + 1.0)) / 5
    connections = (1.0 * 3 + 0.4 * 2.0) / 3
    np.testing.assert_allclose(_distance(one, other), nodes + connections, rtol=1e-6)
