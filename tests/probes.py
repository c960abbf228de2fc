"""Probe tasks: tiny, with known answers, each harder than the last; a method that fails one is broken.

The idea is from rejax: if the first failing probe is the one with a delayed reward, check credit assignment.
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
"""An observation and the right answer bit; None where any answer is accepted."""
Case = tuple[Question, ...]
"""The questions of one episode, in order."""


@pytree
class Asked:
    """The inner state of an episode.

    Attributes:
        case: which case is being asked.
        time: how many questions have been answered.
        owed: reward earned by the answers so far but not yet paid.
    """

    case: Int[Array, ""]
    time: Int[Array, ""]
    owed: Float[Array, ""]


@dataclass(frozen=True)
class Probe:
    """Questions answered by one action, read as the bit action > 0; a right answer earns 1, a wrong one -1.

    Attributes:
        name: the registered name.
        cases: the possible episodes, all of the same length; level k asks for the first `cases_at_level[k]` of them.
        cases_at_level: ascending, one entry per level.
        paid_late: whether the last reward pays everything.
        error_ends: whether a wrong answer terminates the episode; an episode without errors is then truncated at the
            horizon, like an endless task. Otherwise the last answer terminates it.
    """

    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ()
    action_size: ClassVar[int] = 1
    errors_cost: ClassVar[bool] = True

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
        """The fitness of a policy that is always right: the number of questions that matter."""
        return float(self.matters[0].sum())

    @cached_property
    def observations(self) -> NDArray[np.float32]:
        """The observations, shape [cases, horizon, observation_size]."""
        return np.array([[shown for shown, _ in case] for case in self.cases], np.float32)

    @cached_property
    def wanted(self) -> NDArray[np.bool_]:
        """The right answers, shape [cases, horizon]; meaningless where the answer does not matter."""
        return np.array([[bool(answer) for _, answer in case] for case in self.cases])

    @cached_property
    def matters(self) -> NDArray[np.bool_]:
        """Whether the answer matters, shape [cases, horizon]; the same count in every case."""
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
            Fitness is the mean over cases of an episode's total reward; success is the share of questions answered
            right. Questions after an early end count as wrong.
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
        """Return the observation; after the last question, the last one again."""
        return jnp.asarray(self.observations)[asked.case, jnp.minimum(asked.time, self.horizon - 1)]


CONSTANT: Final = Probe("probe_constant", cases=((((0.0,), 1),), (((1.0,), 1),)), cases_at_level=(2,))
"""Always answer yes: does the method learn anything rewarded?"""
# From here on bits are shown as -1 and 1: to an observation of 0, an untrained network without biases answers 0, a no.
COPY: Final = Probe("probe_copy", cases=((((-1.0,), 0),), (((1.0,), 1),)), cases_at_level=(2,))
"""Repeat the bit: does the policy use its observation?"""
DELAYED: Final = Probe(
    "probe_delayed",
    cases=((((-1.0, 0.0), 0), ((0.0, 1.0), None)), (((1.0, 0.0), 1), ((0.0, 1.0), None))),
    cases_at_level=(2,),
    paid_late=True,
)
"""Repeat the bit; the reward comes one step later, when the bit is not visible: does credit reach the answer?"""
SURVIVAL: Final = Probe(
    "probe_survival",
    cases=((((-1.0,), 0), ((1.0,), 1)), (((1.0,), 1), ((-1.0,), 0))),
    cases_at_level=(2,),
    error_ends=True,
)
"""Repeat two bits; a wrong first answer ends the episode: does the method learn despite early ends?"""
CURRICULUM: Final = Probe(
    "probe_curriculum",
    cases=((((-1.0, -1.0), 0),), (((-1.0, 1.0), 1),), (((1.0, -1.0), 1),), (((1.0, 1.0), 0),)),
    cases_at_level=(2, 4),
)
"""Repeat the second bit (level 0); negate it where the first is set (level 1): does the level go up when solved?"""
_ANSWERS: Final = "0001111110000000"
_GATE, *_BEHIND = (
    (tuple(float(place == shown) for place in range(len(_ANSWERS))), int(_ANSWERS[shown]))
    for shown in sorted(range(len(_ANSWERS)), key=lambda place: place != 5)
)
SELECTION: Final = Probe(
    "probe_selection",
    cases=tuple((_GATE, question) for question in _BEHIND),
    cases_at_level=(len(_BEHIND),),
    error_ends=True,
)
"""Know 16 answers by heart, one of which opens the way to the others: are the better policies bred?

These are too many answers for a policy drawn at random, though the best of thousands is judged. Who breeds the worst
gets policies that are wrong at the gate, not everywhere: a mutation that negates all answers would make those right.
The answers change only twice along the inputs, so that HyperNEAT can draw the weights.
"""

PROBES: Final = {probe.name: probe for probe in (CONSTANT, COPY, DELAYED, SURVIVAL, CURRICULUM, SELECTION)}
