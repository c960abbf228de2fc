"""Environments of gymnax as tasks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Final

import jax.numpy as jnp
from jaxtyping import Array, PRNGKeyArray

from evoclaims.core.errors import UserError, require_at_least
from evoclaims.envs.foreign.jax_task import Choice, JaxTask, Moment, Range, actions_of

_LIMIT: Final = "max_steps_in_episode"


@dataclass(frozen=True, kw_only=True)
class GymnaxTask(JaxTask):
    """An environment of gymnax, such as `GymnaxTask("CartPole-v1", episode_steps=500)`.

    Attributes:
        environment_id: as `gymnax.make` takes it.
        parameters: fields of the environment's parameters that differ from the default.
    """

    revision: ClassVar[int] = 5
    packages: ClassVar[tuple[str, ...]] = ("gymnax",)

    parameters: Mapping[str, Any] = field(default_factory=dict, hash=False, kw_only=False)

    def __post_init__(self) -> None:
        """Check the numbers, the environment's own limit of steps among them."""
        super().__post_init__()
        require_at_least(1, f"{self.name}'s", **{_LIMIT: self.parameters.get(_LIMIT, 1)})

    @property
    def given(self) -> Mapping[str, Any]:
        """The parameters."""
        return self.parameters

    def make(self) -> tuple[Any, Any]:
        """Return gymnax's environment and its parameters.

        Raises:
            UserError: when gymnax is not installed, or does not know the environment or a parameter.
        """
        try:
            import gymnax
        except ImportError as error:
            raise UserError(
                f"{self.name} needs gymnax, which cannot be imported ({error}). Install it: pip install gymnax."
            ) from error
        with self.making("gymnax"):
            environment, parameters = gymnax.make(self.environment_id)
            return environment, parameters.replace(**self.parameters)

    @cached_property
    def actions(self) -> Choice | Range:
        """How actions are chosen."""
        environment, parameters = self._made
        return actions_of(environment.action_space(parameters), self.name)

    def begin(self, key: PRNGKeyArray) -> Moment:
        """Start an episode."""
        environment, parameters = self._made
        observation, state = environment.reset_env(key, parameters)
        no = jnp.zeros((), bool)
        return Moment(state=state, observation=observation, reward=jnp.zeros(()), terminated=no)

    def advance(self, key: PRNGKeyArray, state: Any, action: Array) -> Moment:
        """Act once; the environment's own limit of steps truncates the episode, too."""
        environment, parameters = self._made
        observation, state, reward, done, _ = environment.step_env(key, state, action, parameters)
        done, truncated = jnp.asarray(done, bool), jnp.zeros((), bool)
        limit = getattr(parameters, _LIMIT, None)
        if limit is not None and hasattr(state, "time"):  # gymnax does not say which of both has ended an episode
            longer = parameters.replace(max_steps_in_episode=limit + 1)
            truncated = done & (state.time >= limit) & ~jnp.asarray(environment.is_terminal(state, longer), bool)
        return Moment(
            state=state,
            observation=observation,
            reward=jnp.asarray(reward, jnp.float32),
            terminated=done & ~truncated,
            truncated=truncated,
        )
