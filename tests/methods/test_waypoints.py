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
from evoclaims.envs.ecorobot.robot_task import Outing
from evoclaims.envs.ecorobot.robots import ANT
from evoclaims.envs.ecorobot.stones import ARENA, BONUS, STONES, TARGET, SteppingStones
from reproductions.nisioti2025.waypoints import Waypoints

pytestmark = pytest.mark.slow

METHOD, TASK = Waypoints(), SteppingStones(shows_goal=True)
STARTS, STRAIGHT, WAITING = 64, 8, 4
LEVEL = jnp.zeros((), jnp.int32)


def _straight(observation: jax.Array) -> jax.Array:
    """Push towards the target at full force."""
    east, north = jnp.sign(jnp.asarray(TARGET, jnp.float32) - observation[:2])
    return jnp.maximum(jnp.stack([north, east, -east, -north]), 0.0)


def _waiting(observation: jax.Array, action: jax.Array) -> jax.Array:
    """Go where the action leads, but keep 0.3 m off the target once it is next."""
    there = jnp.all(observation[-2:] == jnp.asarray(TARGET, jnp.float32)) & (observation[0] < TARGET[0] + 0.3)
    return jnp.where(there, jnp.array([0.0, 1.0, 0.0, 0.0]), action)


@cache
def _ways() -> tuple[Outing, jax.Array]:
    """Return ways, leaves [starts, steps, …], and which steps count.

    The first know the maze, `STRAIGHT` run at the target, and the last know the maze and wait before the target.
    """
    policy = METHOD.best(TASK, METHOD.init(jax.random.key(0), TASK))

    def way(key: jax.Array, kind: jax.Array) -> tuple[Outing, jax.Array]:
        def act(seen: jax.Array) -> jax.Array:
            return jnp.select([kind == 0, kind == 1], [policy(seen), _straight(seen)], _waiting(seen, policy(seen)))

        return TASK.trajectory(act, key)

    kinds = jnp.repeat(jnp.arange(3), jnp.array([STARTS, STRAIGHT, WAITING]))
    ways: tuple[Outing, jax.Array] = jax.jit(jax.vmap(way))(jax.random.split(jax.random.key(7), len(kinds)), kinds)
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


def _reward(path: np.ndarray) -> float:
    """Return what a path earns: at each step the stones crossed, and the way to the next; a bonus at the last."""
    crossed = np.searchsorted(_crossings(path), np.arange(len(path)), side="right")
    next_stones = np.array(STONES)[np.minimum(crossed, len(STONES) - 1)]
    near = 1.0 - np.linalg.norm(path - next_stones, axis=1) / ARENA
    return float(np.sum(crossed + near)) + BONUS * (crossed[-1] == len(STONES))


def test_who_waits_before_the_target_earns_twice_what_crossing_it_pays() -> None:
    """docs/protocol.md says so: S4 and S8 judge rewards, and rewards among stones are not stones."""
    way, alive = jax.tree.map(np.asarray, _ways())
    earned = [
        _reward(path[living]) for path, living in zip(way.pose.place[..., :2].astype(np.float64), alive, strict=True)
    ]
    crossing, waiting = np.mean(earned[:STARTS]), np.mean(earned[STARTS + STRAIGHT :])
    assert np.array_equal(way.memory.crossed[STARTS + STRAIGHT :, -1], [len(STONES) - 1] * WAITING)
    assert crossing == pytest.approx(2_530, abs=2)
    assert waiting == pytest.approx(5_460, abs=5)


def test_a_straight_run_at_the_target_crosses_nothing_and_earns_no_bonus() -> None:
    way, alive = jax.tree.map(lambda leaf: np.asarray(leaf)[STARTS : STARTS + STRAIGHT], _ways())
    assert alive.all()
    assert np.max(way.memory.crossed) == 0
    # It ends under a wall: nearer to the target than it started, and nowhere near.
    away = np.linalg.norm(way.pose.place[:, -1, :2] - np.array(TARGET), axis=1)
    assert (away > 1.0).all()
    assert (away < 4.0).all()


@pytest.mark.parametrize(
    "task",
    [SteppingStones(), SteppingStones(robot=ANT, shows_goal=True), DeceptiveMaze(difficulty="difficult")],
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
