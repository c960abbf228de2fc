"""Nothing gets through a wall, at the highest speed that there is."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.envs.base import TaskState
from evoclaims.envs.ecorobot import physics
from evoclaims.envs.ecorobot.physics import Body
from evoclaims.envs.ecorobot.stones import SteppingStones

pytestmark = pytest.mark.slow

TASK = SteppingStones()
ROBOTS, STEPS, KEPT = 1_000, 80, 40
"""Every robot is pushed one way for `KEPT` steps, then another."""


def _gaps(points: np.ndarray) -> np.ndarray:
    """Return how far each point is from the nearest wall; negative inside one, by how deep."""
    nearest = np.full(points.shape[:-1], np.inf)
    for box in TASK.boxes:
        local = (points - np.array(box.centre)) @ box.rotation[:2, :2]
        beyond = np.abs(local) - np.array(box.half_size)
        outside = np.hypot(*np.moveaxis(np.maximum(beyond, 0.0), -1, 0))
        nearest = np.minimum(nearest, np.where(outside > 0, outside, beyond.max(axis=-1)))
    return nearest


def test_a_thousand_robots_at_full_force_run_into_walls_and_never_through_one() -> None:
    random = np.random.default_rng(0)
    (low_x, high_x), (low_y, high_y) = TASK.area
    cells = np.argwhere(TASK.reachable())
    chosen = (cells[random.integers(len(cells), size=ROBOTS)] + 0.5) / 50
    starts = np.array([low_x, low_y]) + chosen * np.array([high_x - low_x, high_y - low_y])
    # Motors at their limit: 2 N along both axes, or along one.
    pushes = (random.random((STEPS // KEPT, ROBOTS, 4)) < 0.5).astype(np.float32).repeat(KEPT, axis=0)

    def move(states: TaskState, actions: jax.Array) -> tuple[TaskState, Body]:
        after = jax.vmap(TASK.step)(states, actions)
        return after, after.inner.body

    at = jnp.asarray(np.pad(starts, ((0, 0), (0, 1))), jnp.float32)
    states = jax.vmap(TASK.reset, (0, None))(jax.random.split(jax.random.key(0), ROBOTS), jnp.int32(0))
    bodies = jax.vmap(physics.resting)(at, jnp.zeros((ROBOTS, 3)))
    states = replace(states, inner=replace(states.inner, body=bodies))
    bodies = jax.jit(lambda s: jax.lax.scan(move, s, jnp.asarray(pushes))[1])(states)
    places = np.asarray(bodies.position, np.float64)[..., :2]
    speeds = np.linalg.norm(np.asarray(bodies.velocity)[..., :2], axis=-1)
    gaps = _gaps(places)
    assert np.mean(gaps.min(axis=0) < TASK.robot.torso_radius) > 0.8
    assert np.mean(speeds.max(axis=0) > 1.4) > 0.5
    # A step is shorter than a wall is thick; so nobody got across one whose centre stayed outside of all of them.
    assert np.max(np.linalg.norm(np.diff(places, axis=0), axis=-1)) < 0.2
    # Walls are soft, by a few centimetres.
    assert np.min(gaps) > TASK.robot.torso_radius - 0.05
    assert (places > [low_x, low_y]).all()
    assert (places < [high_x, high_y]).all()
