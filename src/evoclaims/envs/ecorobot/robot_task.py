"""The base of all ecorobot tasks: a robot in a scene, its episodes, and an examination over several starts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, partial
from typing import Any, ClassVar, Final

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.errors import UserError, require_at_least
from evoclaims.core.keys import streams
from evoclaims.core.pytree import pytree, select, strong
from evoclaims.envs.base import Episode, Played, PolicyFn, TaskState, averaged, counted, fitting, played, played_on
from evoclaims.envs.ecorobot import physics
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.fidelity import require_fidelity, require_likeness
from evoclaims.envs.ecorobot.physics import Body
from evoclaims.envs.ecorobot.pose import Pose, torso
from evoclaims.envs.ecorobot.robots import SIMPLE_ROB, Robot, fits_as_built_in
from evoclaims.envs.ecorobot.scene import Places, Scene, scene
from evoclaims.envs.ecorobot.sensors import Sensor
from evoclaims.kernels import episode_in_one_kernel, one_kernel
from evoclaims.networks.base import Bound
from evoclaims.networks.mlp import Mlp


@pytree
class Outing:
    """The inner state of an episode.

    Attributes:
        body: the moving state.
        pose: the torso's.
        time: environment steps made.
        memory: the rule's memory.
        effort: sum of the squared actions so far.
        overturned: steps spent upside-down.
    """

    body: Body
    pose: Pose
    time: Int[Array, ""]
    memory: Any
    effort: Float[Array, ""]
    overturned: Float[Array, ""]


@pytree
class Ruling:
    """The rule's result for one step.

    Attributes:
        memory: the rule's new memory.
        reward: of the step.
        ended: whether the task is over.
    """

    memory: Any
    reward: Float[Array, ""]
    ended: Bool[Array, ""]


ROBOT_PACKAGES: Final = ("llvmlite", "mujoco", "mujoco-mjx")
"""Packages that every robot task depends on; a task declares these and any others it needs."""


@dataclass(frozen=True)
class RobotTask(ABC):
    """A task with one level. A subclass defines name, boxes and `rule`, and if needed `memory` and `measures`.

    Fields must be hashable, and those that `rule`, `memory`, `shown`, `observation_size` and `horizon` read must be
    compared: equal tasks share their kernels.

    Attributes:
        robot: who acts.
        sensor: how it senses the boxes; None for not at all.
        episode_steps: environment steps after which an episode is truncated.
        examined_episodes: episodes, from different starts, over which an examination averages.
        places: the boxes' places, if a program takes them as data; None for the task's own.
        shows_place: whether the policy sees the robot's place in the world.
    """

    levels: ClassVar[int] = 1
    shows_place: ClassVar[bool] = True

    robot: Robot = SIMPLE_ROB
    sensor: Sensor | None = None
    episode_steps: int = 1000
    examined_episodes: int = 10
    places: Places | None = field(default=None, compare=False, repr=False, kw_only=True, metadata={"canonical": False})

    def __post_init__(self) -> None:
        """Check the counts, and a custom robot among the boxes."""
        counts = {"episode_steps": self.episode_steps, "examined_episodes": self.examined_episodes}
        require_at_least(1, f"{self.name}'s", **counts)
        if not isinstance(self.robot, Robot):
            raise UserError(f"{self.name} has robot={self.robot!r}. Write a Robot, such as ANT.")
        if self.sensor is not None and not callable(getattr(self.sensor, "read", None)):
            raise UserError(f"{self.name} has sensor={self.sensor!r}. Write Rangefinders(…), your own sensor, or None.")
        # The built-in robots fit; to compile them takes longer than to load a paper.
        # Where they start is not asked of those that fit anywhere: a task may check only later that it has such a maze.
        anywhere, in_a_plane = (fits_as_built_in(self.robot, in_a_maze=maze) for maze in (True, False))
        if not (anywhere or (in_a_plane and self.start is None)):
            self._require_fit()

    def _require_fit(self) -> None:
        """Compile the robot among the boxes, and check that it can act and starts where the task says."""
        model, robot = self.scene.whole, self.robot
        if not model.nu:
            raise UserError(
                f"The model of the robot {robot.name} has no actuators, so it cannot act. Add an <actuator> section "
                "to its file."
            )
        if self.start is None:
            return
        data = mujoco.MjData(model)
        data.qpos[:] = self.scene.start
        data.qpos[:2] = self.start[: model.nq]
        mujoco.mj_kinematics(model, data)
        place = data.xpos[1][:2]
        if not np.allclose(place, self.start, atol=1e-5):
            raise UserError(
                f"{self.name} starts its robots at x {self.start[0]:g} and y {self.start[1]:g}, but with these as "
                f"the first two positions of {robot.name} its torso is at x {place[0]:g} and y {place[1]:g}. Give "
                "the torso a free joint, or slides along x and y as its first joints, and place it at x 0 and y 0."
            )

    def check(self) -> None:
        """Compare a custom robot's frames with MuJoCo's; see `require_fidelity`."""
        require_fidelity(self.scene)

    @property
    @abstractmethod
    def name(self) -> str:
        """The registered name."""

    @property
    @abstractmethod
    def revision(self) -> int:
        """Increased whenever the task's results change."""

    @property
    @abstractmethod
    def boxes(self) -> tuple[Box, ...]:
        """The boxes in the world."""

    @abstractmethod
    def rule(self, memory: Any, before: Pose, after: Pose, action: Float[Array, " action"]) -> Ruling:
        """Judge one step."""

    @property
    def start(self) -> tuple[float, float] | None:
        """The torso's exact start; None for the robot's own start with noise."""
        return None

    def memory(self, pose: Pose) -> Any:
        """Return the rule's memory at the start."""
        return ()

    def shown(self, outing: Outing) -> Float[Array, " more"]:
        """Return what the policy sees besides positions, velocities and sensors."""
        return jnp.zeros(0)

    def measures(self, outing: Outing) -> Mapping[str, Float[Array, ""]]:
        """Return the task's own metrics of a finished episode."""
        return {}

    def reached(self, outing: Outing) -> Bool[Array, ""]:
        """Whether the task's goal is reached; False for tasks without one."""
        return jnp.zeros((), bool)

    def path_measures(self, path: Float[Array, "steps 2"], alive: Bool[Array, " steps"]) -> Mapping[str, Array]:
        """Return metrics of an examined robot's path; `alive` marks the steps before the episode's end."""
        return {}

    @property
    def horizon(self) -> int:
        """Environment steps of an episode."""
        return self.episode_steps

    @property
    def action_size(self) -> int:
        """Number of motors."""
        return int(self.scene.model.nu)

    @cached_property
    def observation_size(self) -> int:
        """Positions, velocities, readings, and whatever `shown` adds."""
        key = jax.eval_shape(lambda: jax.random.key(0))
        return int(jax.eval_shape(lambda k: self.reset(k, jnp.zeros((), jnp.int32)), key).observation.shape[0])

    @property
    def scene(self) -> Scene:
        """The robot among the boxes."""
        return scene(self.robot, self.boxes)

    @property
    def numbers(self) -> Places:
        """The boxes' places: what programs take as data."""
        return self.scene.turns if self.places is None else self.places

    def with_numbers(self, numbers: Places | None) -> RobotTask:
        """Return the task with its boxes moved; None for its own places."""
        moved = copy(self)  # unlike `replace`, it keeps cached values (`observation_size`)
        object.__setattr__(moved, "places", numbers)
        return moved

    def reset(self, key: PRNGKeyArray, level: Int[Array, ""]) -> TaskState:
        """Put the robot at the start, as Brax does: with a little noise on positions and velocities.

        What follows from these, `plain_start`, is one kernel (`one_kernel`).
        """
        position_key, velocity_key = streams(key, "position", "velocity")
        robot, start = self.robot, jnp.asarray(self.scene.start)
        position = start + jax.random.uniform(
            position_key, start.shape, minval=-robot.position_noise, maxval=robot.position_noise
        )
        if self.start is not None:
            position = position.at[:2].set(jnp.asarray(self.start, jnp.float32))
        draw = jax.random.normal if robot.normal_velocity else partial(jax.random.uniform, minval=-1.0, maxval=1.0)
        velocity = robot.velocity_noise * draw(velocity_key, (int(self.scene.model.nv),))
        return _start_kernel(self.with_numbers(None))(position, velocity, self.numbers)

    def plain_start(self, position: Float[Array, " nq"], velocity: Float[Array, " nv"]) -> TaskState:
        """Return the state at the start of an episode."""
        self.check()
        pose = torso(self.scene, position)
        outing = strong(
            Outing(
                body=physics.resting(position, velocity),
                pose=pose,
                time=jnp.zeros((), jnp.int32),
                memory=self.memory(pose),
                effort=jnp.zeros(()),
                overturned=jnp.zeros(()),
            )
        )
        no = jnp.zeros((), bool)
        return TaskState(
            observation=self._observe(outing), reward=jnp.zeros(()), terminated=no, truncated=no, inner=outing
        )

    def step(self, state: TaskState, action: Float[Array, " action"]) -> TaskState:
        """Act for `robot.frames` simulation steps: `plain_step` as one kernel (`one_kernel`)."""
        action = fitting(self, action)
        return _step_kernel(self.with_numbers(None))(state, action, self.numbers)

    def plain_step(self, state: TaskState, action: Float[Array, " action"]) -> TaskState:
        """Act for `robot.frames` simulation steps.

        A step in which the simulation diverges (`physics.is_stable`) is undone: no reward, and the episode ends.
        """
        self.check()
        require_likeness(self.robot)
        outing: Outing = state.inner
        control = action
        if self.robot.scales_actions:
            low, high = jnp.asarray(self.scene.model.actuator_ctrlrange, jnp.float32).T
            control = low + (action + 1.0) * (high - low) / 2.0
        body = physics.act(self.scene, outing.body, control, self.numbers)
        stable = physics.is_stable(body)
        body = select(stable, body, outing.body)
        pose = torso(self.scene, body.position)
        ruling = self.rule(outing.memory, outing.pose, pose, control)
        following = strong(
            Outing(
                body=body,
                pose=pose,
                time=outing.time + 1,
                memory=ruling.memory,
                effort=outing.effort + jnp.sum(control**2),
                overturned=outing.overturned + pose.upside_down.astype(jnp.float32),
            )
        )
        ended = ruling.ended | ~stable
        return TaskState(
            observation=self._observe(following),
            reward=jnp.where(stable, ruling.reward, 0.0),
            terminated=ended,
            truncated=(following.time >= self.episode_steps) & ~ended,
            inner=following,
        )

    def episode(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Run one episode: fitness is the sum of its rewards, success whether the goal was reached."""
        return self._play(policy, key, level, follow=False)

    def examine(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Run `examined_episodes` from different starts and average; success is the share that reached the goal."""
        keys = jax.random.split(key, self.examined_episodes)
        episodes: Episode = jax.vmap(lambda k: self._play(policy, k, level, follow=True))(keys)
        return averaged(episodes)

    def trajectory(self, policy: PolicyFn, key: PRNGKeyArray) -> tuple[Outing, Bool[Array, " steps"]]:
        """Return all states of one episode, leaves [steps, …], and which belong to it, for pictures."""
        start = self.reset(key, jnp.zeros((), jnp.int32))
        way: tuple[Outing, Array] = played(self, policy, start, lambda state: state.inner)[2]
        return way

    def _play(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""], follow: bool) -> Episode:
        """Play to the end; with `follow`, record the path for `path_measures`."""
        start = self.reset(key, level)
        if follow:
            state, total, way = played(self, policy, start, lambda state: state.inner.pose.place[:2])
        else:
            (state, total), way = self._played(policy, start), ()
        outing: Outing = state.inner
        steps = outing.time.astype(jnp.float32)
        engine = {
            "x": outing.pose.place[0],
            "y": outing.pose.place[1],
            "reached": self.reached(outing).astype(jnp.float32),
            "control_cost": self.robot.control_cost * outing.effort,
            "effort": outing.effort,
            "upside_down": outing.overturned / steps,
            "episode_steps": steps,
        }
        own = {**self.measures(outing), **(self.path_measures(*way) if follow else {})}
        if taken := sorted(engine.keys() & own):
            raise UserError(f"All robots' tasks have {', '.join(taken)}. Rename these measures of {self.name!r}.")
        return Episode(fitness=total, success=engine["reached"], metrics={**engine, **own})

    def _played(self, policy: PolicyFn, start: TaskState) -> tuple[TaskState, Float[Array, ""]]:
        """Play from `start`; on a GPU, a perceptron's whole episode is one kernel (`episode_in_one_kernel`)."""
        own_steps = type(self).step is not RobotTask.step
        if own_steps or not isinstance(policy, Bound) or not _is_dense(policy, self.action_size):
            state, total, _ = played(self, policy, start)
        else:
            so_far = (start, jnp.zeros(()), jnp.ones((), bool))
            network: Any = policy.network
            play = _episode_kernel(self.with_numbers(None), network)
            state, total, _ = play(so_far, policy.parameters, self.numbers)
        return state, total

    def _observe(self, outing: Outing) -> Float[Array, " observation"]:
        """Return positions, velocities, readings, and whatever `shown` adds."""
        robot, body = self.robot, outing.body
        limit = robot.velocity_limit
        parts = [
            body.position if self.shows_place else body.position[robot.free_coordinates :],
            jnp.clip(body.velocity[: robot.seen_velocities], -limit, limit),
            self.shown(outing),
        ]
        if self.sensor is not None:
            parts.insert(2, self.sensor.read(self.scene, outing.pose))
        return jnp.concatenate(parts)


def limbs_of(scene: Scene, state: TaskState) -> list[list[Any]]:
    """Return a state's numbers that belong to each of the robot's limbs (`Scene.limbs`), in the same order."""
    body = state.inner.body
    return [[*body.position[at], *body.velocity[moving], *body.acceleration[moving]] for at, moving in scene.limbs]


@lru_cache(maxsize=64)
def _start_kernel(task: RobotTask) -> Callable[[Array, Array, Places], TaskState]:
    """Return a task's start, with its boxes' places as an argument."""
    return one_kernel(
        lambda position, velocity, places: task.with_numbers(places).plain_start(position, velocity),
        f"A start of {task.name}",
    )


@lru_cache(maxsize=64)
def _step_kernel(task: RobotTask) -> Callable[[TaskState, Array, Places], TaskState]:
    """Return a task's step, with its boxes' places as an argument."""
    return one_kernel(
        lambda state, action, places: task.with_numbers(places).plain_step(state, action),
        f"A step of {task.name}",
        parts=lambda state, action, places: limbs_of(task.scene, state),
    )


def _is_dense(policy: Bound, outputs: int) -> bool:
    """Whether a policy computes what the kernel of episodes does; what is built on these classes may not."""
    network = policy.network
    return type(policy) is Bound and type(network) is Mlp and not network.skip and policy.outputs == outputs


@lru_cache(maxsize=64)
def _episode_kernel(task: RobotTask, network: Mlp) -> Callable[[Played, Array, Places], Played]:
    """Return an episode of an `Mlp`, with its parameters and the boxes' places as arguments."""

    def play(so_far: Played, parameters: Array, places: Places) -> Played:
        return played_on(task.with_numbers(places), Bound(network, parameters, task.action_size), so_far)[0]

    def step(before: Played, action: Array, places: Places) -> Played:
        return counted(before, task.with_numbers(places).plain_step(before[0], action))

    widths = (task.observation_size, *network.layers, task.action_size)
    return episode_in_one_kernel(play, step, task.horizon, widths, f"An episode of {task.name}")
