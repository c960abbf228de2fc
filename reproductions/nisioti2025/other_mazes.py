"""The easy maze as the authors' code has it, and a network with a state among the stones."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import ClassVar, Final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray

from evoclaims.core.errors import require_at_least
from evoclaims.envs import DeceptiveMaze, Episode, Pose, Ruling
from evoclaims.envs.base import TaskState
from evoclaims.envs.ecorobot.deceptive import EASY, Approach
from evoclaims.envs.ecorobot.robot_task import Outing
from evoclaims.envs.ecorobot.scene import Scene
from evoclaims.envs.ecorobot.sensors import Sensor
from reproductions.nisioti2025.other_stones import MetreRanges, OtherStones

EXAMINED_STEPS: Final = 300
"""Of an examination, and of PPO's training; NEAT and HyperNEAT train on the default of TensorNEAT, 1,000."""
CREDITED: Final = math.dist((0.0, 0.0), EASY.target) - math.dist(EASY.start, EASY.target)
"""Paid for the first step beside its own progress: the way from the origin to the start, 1.79 m."""


@dataclass(frozen=True)
class OffsetRanges(MetreRanges):
    """The same, mounted `offset` (m, along the torso's own axes) away from the torso."""

    offset: tuple[float, float] = EASY.start

    def read(self, scene: Scene, pose: Pose) -> Float[Array, " size"]:
        """Return the distance of each ray, m."""
        away = pose.rotation @ jnp.asarray(np.array([*self.offset, 0.0], np.float32))
        return super().read(scene, replace(pose, place=pose.place + away))


@dataclass(frozen=True)
class EasyMazeAsCoded(DeceptiveMaze):
    """The easy maze: progress in metres, the way to the target shown, other ranges, a shorter examination.

    Attributes:
        examined_steps: environment steps of an examination's episodes.
        seen_positions: how many of the robot's positions a policy sees, from the first.
    """

    name: ClassVar[str] = "easy_maze_as_coded"
    revision: ClassVar[int] = 1

    sensor: Sensor | None = OffsetRanges()
    examined_steps: int = EXAMINED_STEPS
    seen_positions: int = 3

    def __post_init__(self) -> None:
        """Check the counts."""
        super().__post_init__()
        require_at_least(1, f"{self.name}'s", examined_steps=self.examined_steps, seen_positions=self.seen_positions)

    @property
    def whole_way(self) -> float:
        """What a way to the target pays, 8.75."""
        return math.dist((0.0, 0.0), self.target) - self.plan.within

    def memory(self, pose: Pose) -> Approach:
        """Store the way that the first step is paid for, beside its own: the robot was moved from the origin."""
        return Approach(first=jnp.asarray(CREDITED, jnp.float32), done=jnp.zeros((), bool))

    def rule(self, memory: Approach, before: Pose, after: Pose, action: Float[Array, " action"]) -> Ruling:
        """Pay the decrease of the distance to the target, m; end near the target."""
        distance = self._distance(after)
        reached = distance <= 0.0
        return Ruling(
            memory=Approach(first=jnp.zeros(()), done=memory.done | reached),
            reward=memory.first + self._distance(before) - distance,
            ended=reached,
        )

    def shown(self, outing: Outing) -> Float[Array, " more"]:
        """Return the way from the target to the robot, m."""
        return outing.pose.place[:2] - jnp.asarray(self.target, jnp.float32)

    def examine(self, policy: Callable[[Array], Array], key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Run `examined_episodes` of `examined_steps`."""
        return DeceptiveMaze.examine(replace(self, episode_steps=self.examined_steps), policy, key, level)

    def _observe(self, outing: Outing) -> Float[Array, " observation"]:
        """Return what the robot sees, with only some of its positions."""
        seen = super()._observe(outing)
        return jnp.concatenate([seen[: self.seen_positions], seen[outing.body.position.shape[0] :]])


@dataclass(frozen=True)
class RememberingStones(OtherStones):
    """Stones for a policy with a state: its last outputs come back as its last inputs, zeros at first.

    Attributes:
        remembered: how many outputs beside the motors'.
    """

    name: ClassVar[str] = "remembering_stones"  # type: ignore[misc]
    revision: ClassVar[int] = 1

    remembered: int = 24

    @property
    def action_size(self) -> int:
        """Motors, then what is remembered."""
        return super().action_size + self.remembered

    def plain_start(self, position: Float[Array, " nq"], velocity: Float[Array, " nv"]) -> TaskState:
        """Return the state at the start of an episode."""
        state = super().plain_start(position, velocity)
        return replace(state, observation=jnp.concatenate([state.observation, jnp.zeros(self.remembered)]))

    def plain_step(self, state: TaskState, action: Float[Array, " action"]) -> TaskState:
        """Act, and show what is remembered."""
        motors = action.shape[0] - self.remembered
        following = super().plain_step(state, action[:motors])
        return replace(following, observation=jnp.concatenate([following.observation, action[motors:]]))


@dataclass(frozen=True)
class Recurrent:
    """Tanh neurons that all feed each other, for some rounds a step, and keep their state; tanh outputs.

    Parameters, in order: weights from inputs, neurons and a bias to neurons, [hidden, inputs + hidden + 1]; from
    neurons and a bias to outputs, [outputs, hidden + 1]. The state is the last `hidden` inputs, and the last outputs.
    """

    name: str = field(default="recurrent", init=False)
    hidden: int = 24
    rounds: int = 5

    def __post_init__(self) -> None:
        """Check the counts."""
        require_at_least(1, "A recurrent network's", hidden=self.hidden, rounds=self.rounds)

    def size(self, inputs: int, outputs: int) -> int:
        """Return the number of parameters."""
        return self.hidden * (inputs + 1) + (outputs - self.hidden) * (self.hidden + 1)

    def apply(
        self, parameters: Float[Array, " parameters"], observation: Float[Array, " inputs"], outputs: int
    ) -> Float[Array, " outputs"]:
        """Map one observation and state to outputs and the next state, each in (-1, 1)."""
        inputs, neurons = observation.shape[0], self.hidden
        first = neurons * (inputs + 1)
        weights = parameters[:first].reshape(neurons, inputs + 1)
        readout = parameters[first:].reshape(outputs - neurons, neurons + 1)
        seen, state = observation[: inputs - neurons], observation[inputs - neurons :]
        given = jnp.sum(weights[:, : inputs - neurons] * seen[None], axis=1) + weights[:, -1]
        for _ in range(self.rounds):
            fed = jnp.sum(weights[:, inputs - neurons : inputs] * state[None], axis=1)
            state = jnp.tanh(given + fed)
        motors = jnp.tanh(jnp.sum(readout[:, :-1] * state[None], axis=1) + readout[:, -1])
        return jnp.concatenate([motors, state])
