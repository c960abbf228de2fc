"""The positive control of MAP-Elites: on a reduced budget it gets around the wall that the straight way ends at."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import pytest

from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.methods.map_elites import MapElites, MapElitesState
from evoclaims.networks.mlp import Mlp
from evoclaims.trials.devices import MATMUL_PRECISION

pytestmark = pytest.mark.slow

TASK = DeceptiveMaze(difficulty="easy", episode_steps=400)
METHOD = MapElites(network=Mlp((16,)), batch=64, initial=128, cells=(16, 14), iso_sigma=0.5, line_sigma=0.3)
AT_ONCE, MOST = 5, 300
"""Iterations in one program, and at most: 19,200 policies of 400 steps. The paper has 100,000, of 1,000 steps."""


@partial(jax.jit, compiler_options={"xla_backend_optimization_level": 1})
def _grow(key: jax.Array, first: jax.Array, state: MapElitesState) -> MapElitesState:
    """Return the state after `AT_ONCE` more iterations."""

    def iteration(state: MapElitesState, index: jax.Array) -> tuple[MapElitesState, None]:
        return METHOD.step(jax.random.fold_in(key, index), TASK, jnp.zeros((), jnp.int32), state)[0], None

    return jax.lax.scan(iteration, state, first + jnp.arange(AT_ONCE))[0]


def test_map_elites_reaches_the_target_of_the_easy_maze() -> None:
    """The way is 13 m, around a bar, and the straight one ends below it.

    Where it was written, it took 2,560 policies. Simulated robots are chaotic, so that rounding elsewhere makes it
    another number: there are seven times as many to spend. That a robot can reach the target of the difficult maze is
    shown by the controller that knows its way (test_waypoints.py).
    """
    key, state = jax.random.key(0), METHOD.init(jax.random.key(0), TASK)
    for first in range(0, MOST, AT_ONCE):
        with jax.default_matmul_precision(MATMUL_PRECISION):
            state = _grow(key, jnp.asarray(first), state)
        if float(state.reached) == 1:
            return
    pytest.fail(f"{int(state.evaluated)} policies did not reach the target")
