"""The controller that knows the maze crosses every stone (C4); one that makes straight for the target does not."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.envs.ecorobot.outing import Outing
from evoclaims.envs.ecorobot.robots import ANT
from evoclaims.envs.ecorobot.stones import STONES, TARGET, SteppingStones
from reproductions.nisioti2025.waypoints import Waypoints

pytestmark = pytest.mark.slow

METHOD, TASK = Waypoints(), SteppingStones(shows_goal=True)
STARTS, STRAIGHT = 64, 8
LEVEL = jnp.zeros((), jnp.int32)


def _straight(observation: jax.Array) -> jax.Array:
    """Push towards the target at full force."""
    east, north = jnp.sign(jnp.asarray(TARGET, jnp.float32) - observation[:2])
    return jnp.maximum(jnp.stack([north, east, -east, -north]), 0.0)


@cache
def _ways() -> tuple[Outing, jax.Array]:
    """Return ways, leaves [starts, steps, …], and which steps count; the last `STRAIGHT` are those of straight runs."""
    policy = METHOD.best(TASK, METHOD.init(jax.random.key(0), TASK))

    def way(key: jax.Array, knows: jax.Array) -> tuple[Outing, jax.Array]:
        return TASK.trajectory(lambda seen: jnp.where(knows, policy(seen), _straight(seen)), key)

    keys = jax.random.split(jax.random.key(7), STARTS + STRAIGHT)
    ways: tuple[Outing, jax.Array] = jax.jit(jax.vmap(way))(keys, jnp.arange(STARTS + STRAIGHT) < STARTS)
    return ways


def _crossings(path: np.ndarray) -> list[int]:
    """Return the stones that a path crosses in their order, each by its first step there."""
    steps: list[int] = []
    for step, place in enumerate(path):
        if len(steps) < len(STONES) and math.dist(place, STONES[len(steps)]) <= TASK.within:
            steps.append(step)
    return steps


def test_all_stones_are_crossed_in_their_order_from_every_start() -> None:
    way, alive = jax.tree.map(lambda leaf: np.asarray(leaf)[:STARTS], _ways())
    assert len(np.unique(way.body.velocity[:, 0], axis=0)) == STARTS
    places, crossed = way.pose.place[..., :2].astype(np.float64), way.memory.crossed
    for path, living, counted in zip(places, alive, crossed, strict=True):
        steps = _crossings(path[living])
        assert len(steps) == len(STONES)
        # Which is what the task counts, too, and the last of them ends the episode.
        np.testing.assert_array_equal(np.flatnonzero(np.diff(counted[living], prepend=0)), steps)
        assert steps[-1] == living.sum() - 1
        assert living.sum() < TASK.horizon


def test_a_straight_run_at_the_target_crosses_nothing_and_earns_no_bonus() -> None:
    way, alive = jax.tree.map(lambda leaf: np.asarray(leaf)[STARTS:], _ways())
    assert alive.all()
    assert np.max(way.memory.crossed) == 0
    # It ends under a wall: nearer to the target than it started, and nowhere near.
    away = np.linalg.norm(way.pose.place[:, -1, :2] - np.array(TARGET), axis=1)
    assert (away > 1.0).all()
    assert (away < 4.0).all()


@pytest.mark.parametrize(
    "task",
    [
        SteppingStones(),
        SteppingStones(robot=ANT, shows_goal=True),
        DeceptiveMaze(difficulty="difficult"),
    ],
    ids=["no goal shown", "ant", "other maze"],
)
def test_only_the_simplest_robot_that_sees_its_goal_is_steered(task: Any) -> None:
    with pytest.raises(UserError, match="Waypoints are known for the stepping stones alone"):
        METHOD.best(task, jnp.zeros((), jnp.int32))


def test_a_step_learns_nothing_and_counts() -> None:
    state, progress = METHOD.step(jax.random.key(0), TASK, LEVEL, METHOD.init(jax.random.key(1), TASK))
    assert int(state) == 1
    assert bool(progress.healthy)
    assert METHOD.cost(TASK) == TASK.horizon
