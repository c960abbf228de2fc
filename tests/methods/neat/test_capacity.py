"""Which size of arrays a generation runs in; that it makes no difference is shown in test_evolution."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from genomes import made, stacked

from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.neat import capacity
from evoclaims.methods.neat.evolution import Neat
from evoclaims.methods.neat.settings import Settings, Species

ALL = [(32, 96), (100, 200), (100, 400)]


@pytest.mark.parametrize(
    ("limits", "ends", "wanted"),
    [
        ((100, 400), (2, 1), ALL),
        ((50, 100), (2, 1), [(32, 96), (50, 100)]),
        ((32, 96), (2, 1), [(32, 96)]),
        ((16, 64), (2, 1), [(16, 64)]),
        ((100, 200), (2, 1), [(32, 96), (100, 200)]),
        # those that the first networks cannot grow in are not offered
        ((100, 400), (30, 1), ALL),
        ((100, 400), (31, 1), ALL[1:]),
        ((100, 400), (5, 19), ALL[1:]),
        ((100, 400), (35, 8), ALL[2:]),
    ],
)
def test_smaller_arrays_are_offered_where_they_are_smaller(
    limits: tuple[int, int], ends: tuple[int, int], wanted: list[tuple[int, int]]
) -> None:
    assert capacity.capacities(Settings(nodes=limits[0], connections=limits[1]), *ends) == wanted


@pytest.mark.parametrize(
    ("nodes", "connections", "wanted"),  # with 100 nodes there is no room for another, whatever the capacity
    [
        (31, 94, (32, 96)),
        (32, 94, (100, 200)),
        (31, 95, (100, 200)),
        (99, 198, (100, 200)),
        (100, 198, (100, 200)),
        (99, 199, (100, 400)),
        (100, 400, (100, 400)),
    ],
)
def test_arrays_have_room_for_one_more_node_and_two_more_connections(
    nodes: int, connections: int, wanted: tuple[int, int]
) -> None:
    small = made([0, 1, 2], {}, capacity=(100, 400))
    large = replace(small, node_count=np.int32(nodes), connection_count=np.int32(connections))

    def size(nodes: int, connections: int) -> jax.Array:
        return jnp.array([nodes, connections], jnp.int32)

    for groups in ((stacked([small, large]),), (stacked([small]), stacked([large, small]))):
        chosen = capacity.in_capacity(
            capacity.capacities(Settings(), 2, 1), groups, lambda n, c, _: size(n, c), jnp.zeros(())
        )
        assert tuple(np.asarray(chosen).tolist()) == wanted


def test_arrays_fit_a_champion_that_is_larger_than_all_genomes() -> None:
    """A method may keep one from long ago."""
    method, task = Neat(Settings(population=8, species=Species(most=3))), NParity(3)
    state = jax.jit(lambda key: method.init(key, task))(jax.random.key(0))
    assert int(method.size_for(task, state)) == 0
    assert int(method.size_for(task, replace(state, champion=replace(state.champion, node_count=np.int32(40))))) == 1
