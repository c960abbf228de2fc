"""Robots that wander about a room: their rays against walks along them, their steps against MuJoCo's own numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray

from evoclaims.core.keys import streams
from evoclaims.envs.base import Task, TaskState, share
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.pose import Pose
from evoclaims.envs.ecorobot.robot_task import ROBOT_PACKAGES, RobotTask, Ruling
from evoclaims.envs.ecorobot.sensors import Rangefinders, Sensor
from evoclaims.methods.base import Policy, Progress

STRIDE: Final = 0.01
"""Between two points of a walk along a ray, m."""
FAR: Final = 0.15
"""From a robot's surface to the nearest box, where it surely touched none during its step, m."""


@dataclass(frozen=True)
class Room(RobotTask):
    """Walls at several angles around the simplest robot, which turns as it starts; nothing is earned."""

    name: ClassVar[str] = "room"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ROBOT_PACKAGES

    sensor: Sensor | None = Rangefinders(reach=6.0)
    episode_steps: int = 40
    examined_episodes: int = 1

    @property
    def boxes(self) -> tuple[Box, ...]:
        """Four boxes, and free ways between them."""
        return (
            Box((1.6, 0.4), (0.8, 0.1), angle=70.0),
            Box((-0.2, 1.5), (0.7, 0.15), angle=20.0),
            Box((-1.7, -0.3), (0.9, 0.1), angle=110.0),
            Box((0.3, -1.4), (0.5, 0.2), angle=0.0),
        )

    def rule(self, memory: Any, before: Pose, after: Pose, action: Float[Array, " action"]) -> Ruling:
        """Pay nothing."""
        return Ruling(memory, reward=jnp.zeros(()), ended=jnp.zeros((), bool))


@dataclass(frozen=True)
class Wanderers:
    """Robots that hold random motors, each for a whole episode, while what they sense and do is computed again.

    Metrics: "rays", the share of rays that end where a walk along them does, within two strides (a walk steps over the
    corner that a ray just touches); "frames", the share of a robot's steps, far from boxes, that end where its motors
    push it in as many frames as it says, within 1 mm. Fitness is the mean length of the rays.

    Attributes:
        robots: how many wander.
    """

    name: ClassVar[str] = "wanderers"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ROBOT_PACKAGES

    robots: int = 16

    def init(self, key: PRNGKeyArray, task: Task) -> tuple[()]:
        """There is nothing to keep."""
        return ()

    def step(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: tuple[()]
    ) -> tuple[tuple[()], Progress]:
        """Wander for an episode."""
        assert isinstance(task, Room)
        assert isinstance(task.sensor, Rangefinders)
        reach, rays = task.sensor.reach, task.sensor.count

        def wander(key: PRNGKeyArray) -> tuple[Array, ...]:
            start_key, push_key = streams(key, "start", "push")
            action = jax.random.uniform(push_key, (task.action_size,), minval=-0.05, maxval=0.15)

            def act(state: TaskState, _: None) -> tuple[TaskState, tuple[Array, ...]]:
                after, body = task.step(state, action), state.inner.body
                pushed = _pushed(task, body.position, body.velocity, action)
                sensed = after.observation[-rays:] * reach
                right_rays = jnp.abs(sensed - _walked(task, after.inner.pose)) <= 2 * STRIDE
                right_step = jnp.max(jnp.abs(after.inner.body.position - pushed)) <= 1e-3
                free = _gap(task, pushed[:2]) > task.robot.torso_radius + FAR
                return after, (right_rays, right_step, free, sensed)

            done: tuple[Array, ...] = jax.lax.scan(act, task.reset(start_key, level), None, length=task.horizon)[1]
            return done

        right_rays, right_steps, free, sensed = jax.vmap(wander)(jax.random.split(key, self.robots))
        metrics = {
            "rays": share(jnp.sum(right_rays), jnp.asarray(right_rays.size)),
            "frames": share(jnp.sum(right_steps & free), jnp.sum(free)),
        }
        return (), Progress(jnp.mean(sensed), jnp.zeros(()), jnp.ones((), bool), metrics)

    def best(self, task: Task, state: tuple[()]) -> Policy:
        """Return a policy that does nothing."""
        return Policy(jnp.zeros(task.action_size), lambda parameters, observation: parameters)

    def cost(self, task: Task) -> int:
        """Return the robots' steps."""
        return self.robots * task.horizon


def _walked(task: Room, pose: Pose) -> Float[Array, " rays"]:
    """Return how far one can walk along each ray before a point is inside a box, m."""
    assert isinstance(task.sensor, Rangefinders)
    angles = pose.heading + jnp.radians(jnp.linspace(-90.0, 90.0, task.sensor.count))
    steps = jnp.arange(0.0, task.sensor.reach, STRIDE)
    ahead = jnp.stack([jnp.cos(angles), jnp.sin(angles)], axis=1)
    points = pose.place[:2] + (task.robot.torso_radius + steps)[None, :, None] * ahead[:, None]
    inside = _gap(task, points) <= 0
    return jnp.where(jnp.any(inside, axis=1), steps[jnp.argmax(inside, axis=1)], task.sensor.reach)


def _gap(task: Room, points: Float[Array, "*n 2"]) -> Float[Array, "*n"]:
    """Return how far points on the ground are from the nearest box, m; 0 inside."""
    gap = jnp.full(points.shape[:-1], jnp.inf)
    for box in task.boxes:
        turn = np.radians(box.angle)
        x, y = points[..., 0] - box.centre[0], points[..., 1] - box.centre[1]
        along, across = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
        beyond = jnp.abs(along) - box.half_size[0], jnp.abs(across) - box.half_size[1]
        gap = jnp.minimum(gap, jnp.hypot(*(jnp.maximum(one, 0.0) for one in beyond)))
    return gap


def _pushed(
    task: Room, position: Float[Array, " joints"], velocity: Float[Array, " joints"], action: Float[Array, " motors"]
) -> Float[Array, " joints"]:
    """Return where the simplest robot is after the frames of a step, if it touches nothing."""
    model = task.scene.whole
    pull = np.zeros((model.nv, model.nu))
    pull[model.actuator_trnid[:, 0], np.arange(model.nu)] = model.actuator_gear[:, 0]
    low, high = model.actuator_ctrlrange.T
    force = pull @ jnp.clip(jnp.clip(action, low, high), *model.actuator_forcerange.T)
    body = 1  # the torso: a sphere, whose centre does not move as it turns
    inertia = model.dof_armature + np.array([model.body_mass[body]] * 2 + [model.body_inertia[body, 2]])
    for _ in range(task.robot.frames):
        velocity = velocity + model.opt.timestep * (force - model.dof_damping * velocity) / inertia
        position = position + model.opt.timestep * velocity
    return position
