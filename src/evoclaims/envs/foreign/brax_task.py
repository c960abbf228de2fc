"""Environments of Brax as tasks."""

from __future__ import annotations

import contextlib
import io
import sys
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, PRNGKeyArray

from evoclaims.core.errors import require_known
from evoclaims.envs.foreign.jax_task import JaxTask, Moment, Range
from evoclaims.envs.foreign.scoring import place_of


@dataclass(frozen=True, kw_only=True)
class BraxTask(JaxTask):
    """A registered environment of Brax, such as `BraxTask("inverted_pendulum", settings={"backend": "positional"})`.

    `BraxEnv` is the other way round: an evoclaims task as a Brax environment.

    Attributes:
        environment_id: as `brax.envs.get_environment` takes it.
        settings: its further arguments.
    """

    revision: ClassVar[int] = 4
    packages: ClassVar[tuple[str, ...]] = ("brax", "mujoco", "mujoco-mjx")

    settings: Mapping[str, Any] = field(default_factory=dict, hash=False, kw_only=False)

    @property
    def given(self) -> Mapping[str, Any]:
        """The settings."""
        return self.settings

    @property
    def place(self) -> str:
        """Where the environment's class is, if Brax has been imported, as by whoever registers one."""
        known = getattr(sys.modules.get("brax.envs"), "_envs", {})
        return place_of(known[self.environment_id]) if self.environment_id in known else ""

    def make(self) -> Any:
        """Return Brax's environment, which neither truncates episodes nor resets itself.

        Raises:
            UserError: when Brax does not know the environment, or a setting.
        """
        # MJX, which Brax imports, prints two lines when NVIDIA's warp is not installed; nothing here uses warp.
        with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from brax import envs

            require_known("environment of Brax", self.environment_id, envs._envs)
            with self.making("Brax"):
                return envs.get_environment(self.environment_id, **self.settings)

    @cached_property
    def actions(self) -> Range:
        """Each number is in [-1, 1], as Brax has it."""
        size = int(self._made.action_size)
        return Range((-1.0,) * size, (1.0,) * size, (size,))

    def begin(self, key: PRNGKeyArray) -> Moment:
        """Start an episode."""
        return _moment(self._made.reset(key))

    def advance(self, key: PRNGKeyArray, state: Any, action: Array) -> Moment:
        """Act once; Brax's steps are not random."""
        return _moment(self._made.step(state, action))


def _moment(state: Any) -> Moment:
    return Moment(
        state=state,
        observation=state.obs,
        reward=jnp.asarray(state.reward, jnp.float32),
        terminated=jnp.asarray(state.done) > 0,
    )
