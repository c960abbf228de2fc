"""Ecorobot's tasks as Brax environments, for code that expects those: Brax's agents, QDax's scoring functions."""

from __future__ import annotations

import contextlib
import io
from typing import Any

import jax
import jax.numpy as jnp

from evoclaims.envs.base import TaskState
from evoclaims.envs.ecorobot.robot_task import RobotTask

# MJX, which Brax imports, prints two lines when NVIDIA's warp is not installed; nothing here uses warp.
with contextlib.redirect_stdout(io.StringIO()):
    from brax.envs.base import Env, State


class BraxEnv(Env):  # type: ignore[misc]
    """A task in Brax's API: pure `reset` and `step`, one environment; vmap it, or use Brax's wrappers.

    `State.pipeline_state` is the task's own state. `done` says that the task has ended; Brax's `EpisodeWrapper`, with
    `episode_length` set to `task.horizon`, truncates episodes. Derivatives are those of `task.plain_step`,
    computed without its kernel.
    """

    def __init__(self, task: RobotTask) -> None:
        """Wrap a task."""
        self.task = task

    def reset(self, rng: jax.Array) -> State:
        """Start an episode; `rng` is a key, typed or old-style, as in Brax."""
        key = rng if jnp.issubdtype(rng.dtype, jax.dtypes.prng_key) else jax.random.wrap_key_data(rng)
        return self._state(self.task.reset(key, jnp.zeros((), jnp.int32)), {})

    def step(self, state: State, action: jax.Array) -> State:
        """Act once."""
        return self._state(self.task.step(state.pipeline_state, action), state.info)

    @property
    def observation_size(self) -> int:
        """Length of an observation."""
        return self.task.observation_size

    @property
    def action_size(self) -> int:
        """Number of motors."""
        return self.task.action_size

    @property
    def backend(self) -> str:
        """The physics."""
        return "mjx"

    def _state(self, reached: TaskState, info: Any) -> State:
        """Return a task's state as Brax's; `metrics` holds the torso's position."""
        place = reached.inner.pose.place
        return State(
            pipeline_state=reached,
            obs=reached.observation,
            reward=reached.reward,
            done=reached.terminated.astype(jnp.float32),
            metrics={"x": place[0], "y": place[1]},
            info=info,
        )
