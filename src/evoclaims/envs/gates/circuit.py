"""The base of all stepping gates: a truth table made into a task (§3.1 of the paper)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Literal, get_args

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.errors import require_known
from evoclaims.core.pytree import pytree
from evoclaims.envs.base import Episode, PolicyFn, TaskState, fitting, share
from evoclaims.envs.gates.truth_table import TruthTable

Sampling = Literal["exhaustive", "sampled"]


@pytree
class Row:
    """The inner state of an episode: the level and the row being asked."""

    level: Int[Array, ""]
    index: Int[Array, ""]


class Circuit(ABC):
    """A gate task; a subclass defines `name`, `revision`, `table` and a field `sampling`.

    Attributes:
        sampling: "exhaustive": an episode asks every row of the level in order, and its fitness is minus the mean
            error; "sampled": an episode is one step on a row drawn uniformly from the level. The error of a row is the
            share of its active outputs that are wrong; an output x is read as the bit x > 0.
    """

    sampling: Sampling

    def __post_init__(self) -> None:
        """Check the protocol's name."""
        require_known("way of sampling rows", self.sampling, get_args(Sampling))

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
    def table(self) -> TruthTable:
        """The whole truth table."""

    @property
    def levels(self) -> int:
        """Number of levels."""
        return len(self.table.rows_at_level)

    @property
    def observation_size(self) -> int:
        """Number of input bits."""
        return int(self.table.inputs.shape[1])

    @property
    def action_size(self) -> int:
        """Number of output bits."""
        return int(self.table.targets.shape[1])

    @property
    def horizon(self) -> int:
        """Environment steps of the longest episode."""
        return self.table.rows if self.sampling == "exhaustive" else 1

    def reset(self, key: PRNGKeyArray, level: Int[Array, ""]) -> TaskState:
        """Ask the first row ("exhaustive") or a random one ("sampled")."""
        level = jnp.asarray(level, jnp.int32)
        index = jnp.zeros((), jnp.int32)
        if self.sampling == "sampled":
            index = jax.random.randint(key, (), 0, self._rows(level), jnp.int32)
        return self._asking(Row(level=level, index=index), jnp.zeros(()), jnp.zeros((), bool))

    def step(self, state: TaskState, action: Float[Array, " action"]) -> TaskState:
        """Answer the row being asked; reward is minus the row's error."""
        row: Row = state.inner
        wrong, _ = self._errors(fitting(self, action)[None], row.index[None])
        following = Row(level=row.level, index=row.index + 1)
        last = following.index >= self._rows(row.level)
        ended = jnp.logical_or(last, self.sampling == "sampled")
        return self._asking(following, -wrong[0], ended)

    def episode(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Return the fitness under this task's sampling; success is the whole level's, to exclude lucky level-ups."""
        if self.sampling == "exhaustive":
            return self.examine(policy, key, level)
        index = jax.random.randint(key, (1,), 0, self._rows(level), jnp.int32)
        answer = fitting(self, policy(jnp.asarray(self.table.inputs)[index[0]]))
        wrong, _ = self._errors(answer[None], index)
        return Episode(fitness=-wrong[0], success=self.examine(policy, key, level).success)

    def examine(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Ask every row of `level`: fitness is minus the mean error, success the share of fully correct rows.

        The key is not used: the examination is exhaustive.
        """
        answers = jax.vmap(lambda bits: fitting(self, policy(bits)))(jnp.asarray(self.table.inputs))
        wrong, right = self._errors(answers, jnp.arange(self.table.rows))
        rows = self._rows(level)
        asked = jnp.arange(self.table.rows) < rows
        return Episode(
            fitness=-jnp.sum(jnp.where(asked, wrong, 0.0)) / rows.astype(jnp.float32),
            success=share(jnp.sum(asked & right), rows),
        )

    def _rows(self, level: Int[Array, ""]) -> Int[Array, ""]:
        """Return the number of rows of `level`."""
        return jnp.asarray(self.table.rows_at_level, jnp.int32)[level]

    def _errors(
        self, outputs: Float[Array, "rows action"], index: Int[Array, " rows"]
    ) -> tuple[Float[Array, " rows"], Bool[Array, " rows"]]:
        """Return each row's share of wrong active outputs, and whether none is wrong."""
        active = jnp.asarray(self.table.active)[index]
        wrong = active & ((outputs > 0) != jnp.asarray(self.table.targets)[index])
        share = jnp.sum(wrong, axis=-1) / jnp.sum(active, axis=-1)
        return share.astype(jnp.float32), ~jnp.any(wrong, axis=-1)

    def _asking(self, row: Row, reward: Float[Array, ""], ended: Bool[Array, ""]) -> TaskState:
        """Build the state that shows `row`; past the last row it shows the last row."""
        shown = jnp.minimum(row.index, self.table.rows - 1)
        return TaskState(
            observation=jnp.asarray(self.table.inputs)[shown],
            reward=reward,
            terminated=ended,
            truncated=jnp.zeros((), bool),
            inner=row,
        )
