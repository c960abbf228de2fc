"""Episodes from start to end: starts as Brax has them, motion and pay worked out by hand, and how an end is told."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from plain_mujoco import quickly_compiled

from evoclaims.envs.base import Episode, TaskState
from evoclaims.envs.ecorobot import physics, robot_task
from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.envs.ecorobot.locomotion import Locomotion
from evoclaims.envs.ecorobot.physics import Body
from evoclaims.envs.ecorobot.pose import torso
from evoclaims.envs.ecorobot.robot_task import Outing
from evoclaims.envs.ecorobot.robots import ANT, HOPPER, SIMPLE_ROB, Robot
from evoclaims.envs.ecorobot.scene import Places, Scene
from evoclaims.envs.ecorobot.stones import STONES, SteppingStones, StonesCrossed

pytestmark = pytest.mark.newest

LEVEL = jnp.zeros((), jnp.int32)
PAID = replace(SIMPLE_ROB, control_cost=0.1, healthy_reward=0.5, forward_reward=2.0, velocity_limit=0.5)
MASS = 5 * 4 / 3 * math.pi * 0.2**3 + 1.0  # kg: density 5 kg/m³, and the joints' armature


@pytest.fixture(scope="module")
def gliding() -> Iterator[None]:
    """Let robots keep their velocity, whatever they do and touch: here rules and ends matter, and not physics."""

    def glide(scene: Scene, body: Body, control: jax.Array, places: Places) -> Body:
        moved = jnp.zeros_like(body.position).at[:2].set(0.05 * body.velocity[:2])
        return replace(body, position=body.position + moved)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(physics, "act", glide)
        robot_task._step_kernel.cache_clear()
        yield
    robot_task._step_kernel.cache_clear()  # or tests of other files would get steps that glide


def _changed(state: TaskState, **changes: Any) -> TaskState:
    """Return a state whose episode is elsewhere, or further on."""
    return replace(state, inner=replace(state.inner, **changes))


def _moved(task: Any, state: TaskState, *position: float) -> TaskState:
    """Return the state with the robot at rest at other first positions."""
    body = state.inner.body
    at = body.position.at[: len(position)].set(jnp.asarray(position, jnp.float32))
    body = replace(body, position=at, velocity=jnp.zeros_like(body.velocity))
    return _changed(state, body=body, pose=torso(task.scene, at))


def test_a_pushed_robot_moves_and_is_paid_as_worked_out_by_hand() -> None:
    task = Locomotion(robot=PAID)
    pushes = np.random.default_rng(0).uniform(-0.5, 1.5, (40, 4)).astype(np.float32)
    # Full force for a while: the robot gets faster than the 0.5 m/s to which velocities are shown.
    pushes[10:30] = [0.0, 0.9, -0.3, 0.0]

    def act(state: TaskState, push: jax.Array) -> tuple[TaskState, Any]:
        state = task.step(state, push)
        return state, (state.reward, state.observation, state.inner.body.velocity)

    start = task.reset(jax.random.key(1), LEVEL)
    run = quickly_compiled(lambda state: jax.lax.scan(act, state, jnp.asarray(pushes))[1])
    rewards, observations, velocities = run(start)
    velocity = np.asarray(start.inner.body.velocity, np.float64)
    heading = float(start.inner.body.position[2])
    for push, reward, observation, reached in zip(pushes, rewards, observations, velocities, strict=True):
        north, east, west, south = 20.0 * np.clip(push, 0.0, 0.1)  # motors give 0.1 N at most, times their gear
        way = 0.0
        for _ in range(5):
            force = np.array([east - west, north - south, 0.0])
            inertia = np.array([MASS, MASS, 2 / 5 * (MASS - 1.0) * 0.2**2 + 1.0])
            velocity = velocity + 0.01 * (force - velocity) / inertia
            way, heading = way + 0.01 * velocity[0], heading + 0.01 * velocity[2]
        np.testing.assert_allclose(reached, velocity, atol=1e-5)
        assert float(reward) == pytest.approx(2.0 * way / 0.05 + 0.5 - 0.1 * np.sum(push**2), abs=1e-3)
        np.testing.assert_allclose(observation, [heading, *np.clip(velocity[:2], -0.5, 0.5)], atol=1e-5)
    assert np.max(np.abs(velocities)) > 0.6


def test_actions_that_span_the_range_of_the_motors_are_paid_for_as_controls() -> None:
    task = Locomotion(robot=replace(PAID, scales_actions=True))
    state = _moved(task, task.reset(jax.random.key(0), LEVEL), 0.0, 0.0)
    after = jax.jit(task.step)(state, jnp.asarray([-1.0, 0.0, -1.0, 1.0]))
    # Controls 0, 0.5, 0 and 1: full force to the east and to the south.
    assert float(after.inner.effort) == pytest.approx(1.25)
    assert float(after.inner.body.velocity[0]) == pytest.approx(-float(after.inner.body.velocity[1]))
    assert float(after.inner.body.velocity[0]) == pytest.approx(2.0 * (1 - (1 - 0.01 / MASS) ** 5), rel=1e-4)


@pytest.mark.parametrize(("robot", "scale", "normal"), [(ANT, 0.1, True), (HOPPER, 5e-3, False)])
def test_robots_start_with_braxs_noise(robot: Robot, scale: float, normal: bool) -> None:
    task = Locomotion(robot=robot)
    keys = jax.random.split(jax.random.key(0), 500)
    body = jax.jit(jax.vmap(lambda key: task.reset(key, LEVEL).inner.body))(keys)
    away = np.abs(np.asarray(body.position) - (task.scene.model.qpos0 if robot.start is None else robot.start))
    assert 0.95 * scale < away.max() <= scale * (1 + 1e-3)
    speeds = np.abs(np.asarray(body.velocity)) / scale
    if normal:
        assert np.std(np.asarray(body.velocity)) == pytest.approx(scale, rel=0.05)
        assert speeds.max() > 2.5
    else:
        assert 0.95 < speeds.max() <= 1.0


def test_in_a_maze_noise_moves_the_start_not_in_the_plane_but_in_heading_and_speed() -> None:
    task = SteppingStones(sensor=None)
    starts = jax.jit(jax.vmap(lambda key: task.reset(key, LEVEL).inner))(jax.random.split(jax.random.key(2), 50))
    np.testing.assert_array_equal(starts.pose.place[:, :2], jnp.tile(jnp.asarray([[-3.0, 1.0]]), (50, 1)))
    assert np.ptp(starts.pose.heading) > 0.15
    assert np.all(np.std(starts.body.velocity, axis=0) > 0.05)


def _near_its_end(task: Any, ended: bool) -> TaskState:
    """Return a state from which the next step ends the task, or one like it from which it does not."""
    state = task.reset(jax.random.key(0), LEVEL)
    if isinstance(task, Locomotion):  # a hopper that stands, or one head over heels
        return _moved(task, state, 0.0, 0.0, 2.0 if ended else 0.0)
    if isinstance(task, SteppingStones):
        state = _changed(state, memory=StonesCrossed(crossed=jnp.asarray(6 if ended else 5, jnp.int32)))
    return _moved(task, state, *task.target) if ended or isinstance(task, SteppingStones) else state


@pytest.mark.usefixtures("gliding")
@pytest.mark.parametrize("task", [SteppingStones(), DeceptiveMaze(), Locomotion(robot=HOPPER)], ids=lambda t: t.name)
def test_an_episode_ends_by_the_task_or_else_by_the_time_and_never_by_both(task: Any) -> None:
    cases = [
        _changed(_near_its_end(task, ended), time=jnp.asarray(time, jnp.int32))
        for ended in (False, True)
        for time in (998, 999)
    ]
    states = jax.tree.map(lambda *leaves: jnp.stack(leaves), *cases)
    after = jax.jit(jax.vmap(task.step))(states, jnp.zeros((4, task.action_size)))
    assert after.inner.time.tolist() == [999, 1000, 999, 1000]
    assert after.terminated.tolist() == [False, False, True, True]
    assert after.truncated.tolist() == [False, True, False, False]
    reached = jax.vmap(task.reached)(after.inner)
    assert reached.tolist() == ([False] * 4 if isinstance(task, Locomotion) else [False, False, True, True])
    if isinstance(task, Locomotion):
        assert after.inner.overturned.tolist() == [0.0, 0.0, 1.0, 1.0]


WIDE = SteppingStones(within=20.0, episode_steps=10, examined_episodes=3)  # a stone at every step: seven to the end


@pytest.fixture(scope="module")
def played(gliding: None) -> tuple[Episode, Episode, Outing, jax.Array]:
    """Return an examination, the episodes that it averages, and the way of the first, with the steps that count."""

    def policy(_: jax.Array) -> jax.Array:
        return jnp.asarray([0.0, 0.05, 0.0, 0.0])

    def play(key: jax.Array) -> Any:
        keys = jax.random.split(jax.random.clone(key), WIDE.examined_episodes)
        single = jax.vmap(lambda k: WIDE.episode(policy, k, LEVEL))(keys)
        return WIDE.examine(policy, key, LEVEL), single, *WIDE.trajectory(policy, jax.random.clone(keys[0]))

    made: tuple[Episode, Episode, Outing, jax.Array] = quickly_compiled(play)(jax.random.key(4))
    return made


def test_an_episodes_fitness_is_what_its_steps_paid_until_the_end(played: Any) -> None:
    _, episodes, path, alive = played
    assert alive.tolist() == [True] * 7 + [False] * 3
    assert path.memory.crossed[:7].tolist() == [1, 2, 3, 4, 5, 6, 7]
    expected, places = 0.0, np.asarray(path.pose.place, np.float64)
    for step in range(7):
        following = STONES[min(step + 1, 6)]
        expected += step + 1 + 1 - math.dist(places[step, :2], following) / (8 * math.sqrt(2))
    assert float(episodes.fitness[0]) == pytest.approx(expected + 1000.0, rel=1e-6)
    assert float(episodes.success[0]) == 1.0


def test_an_episodes_metrics_are_those_of_its_last_step(played: Any) -> None:
    _, episodes, path, _ = played
    assert {name: float(numbers[0]) for name, numbers in episodes.metrics.items()} == pytest.approx(
        {
            "x": float(path.pose.place[6, 0]),
            "y": float(path.pose.place[6, 1]),
            "reached": 1.0,
            "stones": 7.0,
            "episode_steps": 7.0,
            "effort": 7 * 0.05**2,
            "control_cost": 0.0,
            "upside_down": 0.0,
        }
    )


def test_an_examination_averages_episodes_and_adds_the_ground_covered(played: Any) -> None:
    examined, episodes, _, _ = played
    assert float(examined.fitness) == pytest.approx(float(np.mean(episodes.fitness)))
    assert np.std(episodes.metrics["x"]) > 0
    metrics = dict(examined.metrics)
    coverage = float(metrics.pop("coverage"))
    for name, number in metrics.items():
        assert float(number) == pytest.approx(float(np.mean(episodes.metrics[name])), rel=1e-5), name
    # In a third of a second nobody leaves the cells around the start, of 0.16 m by 0.14 m.
    assert 1 <= coverage * WIDE.reachable().sum() < 4
