"""Probe tasks: tiny, with known answers, each harder than the last; a method that fails one is broken.

The idea is rejax's: when the first probe that fails is the one with a delayed reward, look at credit assignment.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray
from numpy.typing import NDArray

from evoclaims.core.pytree import pytree
from evoclaims.envs.base import Episode, PolicyFn, TaskState, fitting, share

Question = tuple[tuple[float, ...], int | None]
"""An observation and the bit wanted as its answer; None where any answer will do."""
Case = tuple[Question, ...]
"""The questions of one episode, in order."""


@pytree
class Asked:
    """The inner state of an episode.

    Attributes:
        case: which case is being asked.
        time: how many questions have been answered.
        owed: what the answers so far have earned and the rewards have not yet paid.
    """

    case: Int[Array, ""]
    time: Int[Array, ""]
    owed: Float[Array, ""]


@dataclass(frozen=True)
class Probe:
    """Questions to be answered by one action, read as the bit action > 0; a right answer earns 1, a wrong one -1.

    Attributes:
        name: the registered name.
        cases: the episodes there are, all of the same length; level k asks for the first `cases_at_level[k]` of them.
        cases_at_level: ascending, one entry per level.
        paid_late: whether all is paid by the last reward.
        error_ends: whether a wrong answer terminates the episode; one without errors is then truncated at the horizon,
            as a task that could go on for ever. Otherwise the last answer terminates it.
    """

    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ()
    action_size: ClassVar[int] = 1

    name: str
    cases: tuple[Case, ...]
    cases_at_level: tuple[int, ...]
    paid_late: bool = False
    error_ends: bool = False

    @property
    def levels(self) -> int:
        """Number of levels."""
        return len(self.cases_at_level)

    @property
    def observation_size(self) -> int:
        """Length of an observation."""
        return len(self.cases[0][0][0])

    @property
    def horizon(self) -> int:
        """Questions in an episode."""
        return len(self.cases[0])

    @property
    def best_fitness(self) -> float:
        """The fitness of a policy that is always right: the questions of an episode that matter."""
        return float(self.matters[0].sum())

    @cached_property
    def observations(self) -> NDArray[np.float32]:
        """What is shown, shape [cases, horizon, observation_size]."""
        return np.array([[shown for shown, _ in case] for case in self.cases], np.float32)

    @cached_property
    def wanted(self) -> NDArray[np.bool_]:
        """The right answers, shape [cases, horizon]; meaningless where the answer does not matter."""
        return np.array([[bool(answer) for _, answer in case] for case in self.cases])

    @cached_property
    def matters(self) -> NDArray[np.bool_]:
        """Whether the answer matters, shape [cases, horizon]; every case has as many that do."""
        return np.array([[answer is not None for _, answer in case] for case in self.cases])

    def reset(self, key: PRNGKeyArray, level: Int[Array, ""]) -> TaskState:
        """Start on a random case of `level`."""
        return self._first(jax.random.randint(key, (), 0, self._cases(level), jnp.int32))

    def step(self, state: TaskState, action: Float[Array, " action"]) -> TaskState:
        """Answer the question being asked."""
        asked: Asked = state.inner
        right = (fitting(self, action)[0] > 0) == jnp.asarray(self.wanted)[asked.case, asked.time]
        matters = jnp.asarray(self.matters)[asked.case, asked.time]
        earned = asked.owed + jnp.where(matters, jnp.where(right, 1.0, -1.0), 0.0)
        last = asked.time + 1 >= self.horizon
        failed = matters & ~right if self.error_ends else jnp.zeros((), bool)
        pays = last | failed if self.paid_late else jnp.ones((), bool)
        following = Asked(case=asked.case, time=asked.time + 1, owed=jnp.where(pays, 0.0, earned))
        return TaskState(
            observation=self._shown(following),
            reward=jnp.where(pays, earned, 0.0),
            terminated=failed if self.error_ends else last,
            truncated=last & ~failed if self.error_ends else jnp.zeros((), bool),
            inner=following,
        )

    def episode(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Ask every case of the level, as `examine` does; the key is not used."""
        return self.examine(policy, key, level)

    def examine(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Ask every case of `level`; the key is not used.

        Returns:
            Fitness is the mean over cases of an episode's rewards, success the share of questions answered rightly; a
            question that an ended episode has not reached is not.
        """
        rewards, right = jax.vmap(lambda case: self._play(policy, case))(jnp.arange(len(self.cases), dtype=jnp.int32))
        cases = self._cases(level)
        asked = jnp.arange(len(self.cases)) < cases
        return Episode(
            fitness=jnp.sum(jnp.where(asked, rewards, 0.0)) / cases.astype(jnp.float32),
            success=share(jnp.sum(jnp.where(asked, right, 0)), cases * int(self.best_fitness)),
        )

    def _play(self, policy: PolicyFn, case: Int[Array, ""]) -> tuple[Float[Array, ""], Int[Array, ""]]:
        """Play one case to its end; return the sum of its rewards and the number of right answers that matter."""
        state, alive = self._first(case), jnp.ones((), bool)
        total, right = jnp.zeros(()), jnp.zeros((), jnp.int32)
        for time in range(self.horizon):
            action = fitting(self, policy(state.observation))
            good = ((action[0] > 0) == jnp.asarray(self.wanted)[case, time]) & jnp.asarray(self.matters)[case, time]
            state = self.step(state, action)
            total = total + jnp.where(alive, state.reward, 0.0)
            right = right + (alive & good).astype(jnp.int32)
            alive = alive & ~(state.terminated | state.truncated)
        return total, right

    def _first(self, case: Int[Array, ""]) -> TaskState:
        """Build the state that asks the first question of `case`."""
        asked = Asked(case=case, time=jnp.zeros((), jnp.int32), owed=jnp.zeros(()))
        no: Bool[Array, ""] = jnp.zeros((), bool)
        return TaskState(observation=self._shown(asked), reward=jnp.zeros(()), terminated=no, truncated=no, inner=asked)

    def _cases(self, level: Int[Array, ""]) -> Int[Array, ""]:
        """Return the number of cases of `level`."""
        return jnp.asarray(self.cases_at_level, jnp.int32)[level]

    def _shown(self, asked: Asked) -> Float[Array, " observation"]:
        """Return the observation; past the last question it is the last one's."""
        return jnp.asarray(self.observations)[asked.case, jnp.minimum(asked.time, self.horizon - 1)]


CONSTANT: Final = Probe("probe_constant", cases=((((0.0,), 1),), (((1.0,), 1),)), cases_at_level=(2,))
"""Say yes, whatever is shown: does anything that is rewarded get done?"""
# From here on bits are shown as -1 and 1: an untrained network without biases answers 0, a no, to an observation of 0.
COPY: Final = Probe("probe_copy", cases=((((-1.0,), 0),), (((1.0,), 1),)), cases_at_level=(2,))
"""Repeat the bit: does the policy look at what it is shown?"""
DELAYED: Final = Probe(
    "probe_delayed",
    cases=((((-1.0, 0.0), 0), ((0.0, 1.0), None)), (((1.0, 0.0), 1), ((0.0, 1.0), None))),
    cases_at_level=(2,),
    paid_late=True,
)
"""Repeat the bit and be paid one step later, when nothing shown tells which bit it was: is credit carried back?"""
SURVIVAL: Final = Probe(
    "probe_survival",
    cases=((((-1.0,), 0), ((1.0,), 1)), (((1.0,), 1), ((-1.0,), 0))),
    cases_at_level=(2,),
    error_ends=True,
)
"""Repeat two bits, of which a wrong answer to the first forfeits the second: is a policy trained through early ends?"""
CURRICULUM: Final = Probe(
    "probe_curriculum",
    cases=((((-1.0, -1.0), 0),), (((-1.0, 1.0), 1),), (((1.0, -1.0), 1),), (((1.0, 1.0), 0),)),
    cases_at_level=(2, 4),
)
"""Repeat the second bit (level 0), and negate it where the first is set (level 1): is a level left when solved?"""

PROBES: Final = {probe.name: probe for probe in (CONSTANT, COPY, DELAYED, SURVIVAL, CURRICULUM)}
