"""Ours, which carries three arrays and searches its lines exactly, against MuJoCo in C and against `mjx.step`."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from plain_mujoco import Record, chained, quickly_compiled, record

from evoclaims.core.foreign import implicit_promotions
from evoclaims.envs.ecorobot import physics, stones
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.physics import Body
from evoclaims.envs.ecorobot.robots import ANT, HALF_CHEETAH, HOPPER, HUMANOID, SIMPLE_ROB, WALKER2D, Robot
from evoclaims.envs.ecorobot.scene import Scene, mjx, scene
from evoclaims.kernels import in_numpy

pytestmark = pytest.mark.slow

# Their numbers are sums of powers of two, so that they are the same in float32 (where boxes take turns) and float64.
ROW = tuple(Box((x, 0.0), (0.25, 3.0), bottom=-0.75, top=0.25) for x in (9.0, 11.0, 13.0))


def _frames(world: Scene, made: Record, dtype: Any = jnp.float64) -> Body:
    """Simulate one frame from each of the record's states."""

    def frame(position: jax.Array, velocity: jax.Array, acceleration: jax.Array, control: jax.Array) -> Body:
        body = Body(position=position, velocity=velocity, acceleration=acceleration)
        return physics._frame(world, body, control, world.turns)

    states = (made.position, made.velocity, made.acceleration, made.control)
    body = Body(*in_numpy(frame, *(x.astype(dtype) for x in states)))
    assert body.position.dtype == dtype
    return body


def _off(body: Body, made: Record) -> np.ndarray:
    """Return how far positions are from MuJoCo's after each frame."""
    return np.abs(np.asarray(body.position) - made.next_position).max(axis=1)


@pytest.mark.parametrize(
    ("robot", "walls", "at"),
    [
        (SIMPLE_ROB, stones.WALLS, (-3.65, 0.35)),
        (ANT, stones.WALLS, (-3.3, 0.7)),
        *((robot, (), ()) for robot in (HOPPER, HUMANOID, WALKER2D)),
    ],
    ids=["simple_rob among walls", "ant among walls", "hopper", "humanoid", "walker2d"],
)
def test_a_frame_is_mujocos(robot: Robot, walls: tuple[Box, ...], at: tuple[float, ...]) -> None:
    with jax.enable_x64(True):
        world = Scene(robot, walls)
        made = record(world, 200, at)
        body = _frames(world, made)
    assert np.sum(made.contacts > 0) >= 20
    assert np.max(_off(body, made)) < 1e-12
    assert np.max(np.abs(np.asarray(body.velocity) - made.next_velocity)) < 1e-10


def test_a_frame_in_float32_is_mujocos_but_for_rounding() -> None:
    world = scene(ANT, stones.WALLS)
    made = record(world, 200, (-3.3, 0.7), seed=1)
    assert np.sum(made.contacts > 0) >= 20
    assert np.max(_off(_frames(world, made, jnp.float32), made)) < 1e-5


def test_a_frame_on_obstacles_is_that_of_mjx_though_only_the_two_nearest_are_simulated() -> None:
    """Where a capsule lies on a box's edge, MJX finds other points of contact than MuJoCo in C; elsewhere the same."""
    with jax.enable_x64(True):
        world = Scene(HALF_CHEETAH, ROW)
        assert world.near == 2
        every, blank = mjx.put_model(world.whole, impl="jax"), mjx.make_data(world.whole, impl="jax")
        made = chained(record(world, 40, (x, 0.25), seed) for seed, x in enumerate((8.6, 10.0, 11.2, 12.1, 13.4, 13.9)))

        def theirs(position: jax.Array, velocity: jax.Array, acceleration: jax.Array, control: jax.Array) -> Any:
            with implicit_promotions():
                model = every.replace(opt=every.opt.replace(ls_iterations=50, ls_tolerance=jnp.asarray(1e-10)))
                data = blank.replace(qpos=position, qvel=velocity, ctrl=control)
                after = mjx.step(model, data.replace(qacc_warmstart=acceleration))
                return after.qpos, after.qvel

        ours = _frames(world, made)
        # Copies: on the CPU jax would share memory with MuJoCo's data.
        states = [jnp.array(x.copy()) for x in (made.position, made.velocity, made.acceleration, made.control)]
        position, velocity = quickly_compiled(jax.vmap(theirs))(*states)
    assert np.sum(made.boxed) >= 40
    np.testing.assert_allclose(ours.position, position, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(ours.velocity, velocity, rtol=0.0, atol=1e-10)
    assert np.max(_off(ours, made)[~made.boxed]) < 1e-12
    assert np.mean(_off(ours, made)[made.boxed] < 1e-11) > 0.9


def test_four_hundred_frames_along_walls_stay_with_mujoco() -> None:
    world = scene(SIMPLE_ROB, stones.WALLS)
    data = mujoco.MjData(world.whole)
    data.qpos[:2] = stones.PLAN.start
    # South, then east along the wall, on over the small oblique one, and west into it from the other side.
    pushes = np.repeat([[0, 0, 0, 1], [0, 1, 0, 1], [1, 1, 0, 1], [0, 0, 1, 1]], 20, axis=0).astype(np.float64)
    touching, way = 0, []
    for push in pushes:
        data.ctrl[:] = push
        for _ in range(SIMPLE_ROB.frames):
            mujoco.mj_step(world.whole, data)
            touching += data.ncon > 0
        way.append(data.qpos.copy())

    def act(body: Body, push: jax.Array) -> tuple[Body, jax.Array]:
        body = physics.act(world, body, push, world.turns)
        return body, body.position

    start = physics.resting(jnp.asarray([*stones.PLAN.start, 0.0], jnp.float32), jnp.zeros(3))
    ours = quickly_compiled(lambda body: jax.lax.scan(act, body, jnp.asarray(pushes, jnp.float32)))(start)[1]
    assert touching >= 100
    np.testing.assert_allclose(ours, np.array(way), rtol=0.0, atol=1e-4)
