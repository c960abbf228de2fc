"""The positive control of MAP-Elites: the deceptive maze, where it must get further than policies drawn at random."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.methods.map_elites import MapElites, MapElitesState
from evoclaims.networks.mlp import Mlp

TASK = DeceptiveMaze(difficulty="difficult", episode_steps=300)
METHOD = MapElites(network=Mlp((8,)), batch=128, initial=128, iso_sigma=0.1, line_sigma=0.3)
GENERATIONS = 21
LEVEL = jnp.zeros((), jnp.int32)


def _ways_left() -> NDArray[np.float64]:
    """Return how far it is around the walls from each cell to the target, m; infinity where nobody gets to."""
    ground = TASK.reachable(METHOD.cells)
    low, high = np.array(TASK.area).T
    size = (high - low) / METHOD.cells
    cells = np.argwhere(ground)
    number = {tuple(cell): i for i, cell in enumerate(cells.tolist())}
    edges = [
        (i, number[x + dx, y + dy], float(np.hypot(*(size * (dx, dy)))))
        for (x, y), i in number.items()
        for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1))
        if (x + dx, y + dy) in number
    ]
    here, there, length = zip(*edges, strict=True)
    graph = coo_array((length, (here, there)), shape=(len(cells),) * 2).tocsr()
    target = number[tuple(((np.array(TASK.target) - low) / size).astype(int).tolist())]
    ways = np.full(METHOD.cells, np.inf)
    ways[ground] = dijkstra(graph, directed=False, indices=target)
    return ways


def test_map_elites_gets_further_through_the_maze_than_policies_drawn_at_random() -> None:
    """Straight lines to the target end in a trap: what counts is the way left around the walls, 14 m at the start.

    Of equally many policies, far more of those that vary elites end beyond a third of the way, and they cover more.
    """
    step = jax.jit(lambda key, state: METHOD.step(key, TASK, LEVEL, state))

    def grow(at_random: bool) -> tuple[MapElitesState, Any]:
        state, progress = METHOD.init(jax.random.key(0), TASK), None
        for generation in range(GENERATIONS):
            if at_random:  # one that is always at its beginning
                state = replace(state, evaluated=jnp.zeros((), jnp.int32))
            state, progress = step(jax.random.fold_in(jax.random.key(1), generation), state)
        return state, progress

    (varied, further), (drawn, baseline) = grow(at_random=False), grow(at_random=True)
    ways = _ways_left()
    assert 13.0 < ways[6, 7] < 15.0  # the start's
    beyond = [np.sum((np.asarray(METHOD.fitness_map(state)) > -np.inf) & (ways < 9.0)) for state in (varied, drawn)]
    assert beyond[0] > 1.5 * beyond[1] > 0
    assert float(further.metrics["coverage"]) > 1.25 * float(baseline.metrics["coverage"])
