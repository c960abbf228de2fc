"""The base of all stepping gates: a truth table made into a task (§3.1 of the paper)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar, Literal, get_args

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray
from numpy.typing import NDArray

from evoclaims.core.errors import require_known
from evoclaims.core.pytree import pytree
from evoclaims.envs.base import Episode, MisfitError, PolicyFn, TaskState, fitting, share

Bits = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class TruthTable:
    """A circuit's target behaviour.

    Attributes:
        inputs: bits 0/1, shape [rows, inputs].
        targets: target bits 0/1, shape [rows, outputs]; meaningless where not active.
        active: which outputs are scored, shape [rows, outputs].
        rows_at_level: how many leading rows each level asks for, ascending, one entry per level.
    """

    inputs: NDArray[np.float32]
    targets: NDArray[np.bool_]
    active: NDArray[np.bool_]
    rows_at_level: tuple[int, ...]

    def __post_init__(self) -> None:
        """Check that the parts fit together; jax would broadcast wrong shapes, and read past the last row.

        Raises:
            MisfitError: when shapes or types are wrong, a row asks nothing, or level rows do not ascend to all rows.
        """
        rows = len(self.inputs)
        wanted: tuple[tuple[str, NDArray[Any], type], ...] = (
            ("inputs", self.inputs, np.float32),
            ("targets", self.targets, np.bool_),
            ("active", self.active, np.bool_),
        )
        for name, part, dtype in wanted:
            if part.ndim != 2 or len(part) != rows or part.dtype != dtype:
                raise MisfitError(
                    f"a truth table has {name} of shape {part.shape} and type {part.dtype}: write an array of shape "
                    f"[{rows}, …] and type {np.dtype(dtype)}"
                )
        if self.active.shape != self.targets.shape:
            raise MisfitError(
                f"a truth table has active outputs of shape {self.active.shape} and targets of shape "
                f"{self.targets.shape}: give both one shape"
            )
        if not self.active.any(axis=1).all():  # its share of wrong answers would be NaN
            raise MisfitError(
                "a truth table has a row without an active output, which asks nothing: activate at least one output "
                "of each row"
            )
        levels = self.rows_at_level
        if not levels or levels[0] < 1 or levels[-1] != rows or any(b <= a for a, b in pairwise(levels)):
            raise MisfitError(
                f"a truth table has rows_at_level={levels}: write numbers above 0 that increase up to {rows}, the "
                "number of all rows"
            )

    @property
    def rows(self) -> int:
        """Rows of the last level."""
        return self.rows_at_level[-1]


def bits_of(number: int, width: int) -> Bits:
    """Return `number` as `width` bits, most significant first."""
    return tuple((number >> shift) & 1 for shift in reversed(range(width)))


def number_of(bits: Sequence[int]) -> int:
    """Return the number with these `bits`, most significant first."""
    return sum(bit << shift for shift, bit in enumerate(reversed(bits)))


@dataclass(frozen=True)
class Operation:
    """A logical operation on the last `inputs` data bits; `compute` maps them to the leading output bits."""

    name: str
    inputs: int
    outputs: int
    compute: Callable[[Bits], Bits]


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
            share of its active outputs that are wrong; an output x is read as the bit x > 0, and NaN is wrong.
    """

    errors_cost: ClassVar[bool] = True
    """Exactly an error's reward is below 0."""

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
        return jnp.asarray(self.table.rows_at_level, jnp.int32)[level]

    def _errors(
        self, outputs: Float[Array, "rows action"], index: Int[Array, " rows"]
    ) -> tuple[Float[Array, " rows"], Bool[Array, " rows"]]:
        """Return each row's share of wrong active outputs, and whether none is wrong; no number is no answer."""
        active = jnp.asarray(self.table.active)[index]
        wrong = active & (((outputs > 0) != jnp.asarray(self.table.targets)[index]) | jnp.isnan(outputs))
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
