"""Faults that are planted in a method or a task: the same parameters, with one of its functions replaced by a bug."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from typing import Any, ClassVar, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray

from evoclaims.core.errors import UserError
from evoclaims.core.keys import stream
from evoclaims.envs.base import Episode, PolicyFn, Task, TaskState, fitting
from evoclaims.envs.gates.circuit import TruthTable
from evoclaims.methods.base import Policy, Progress
from evoclaims.methods.cma_es import CmaEsState

F = TypeVar("F", bound="Fault")


class Fault:
    """What a fault replaces; a subclass overrides functions of the method or task that it is planted in.

    A faulty component is also an instance of the sound one's class, since methods and reports check a task's class. Its
    name differs, so that it has its own trials, and code for sound components has no switch for faults.
    """

    says: ClassVar[str]
    _sound_class: ClassVar[type]

    @property
    def sound(self) -> Any:
        """The component without the fault."""
        made: Any = object.__new__(self._sound_class)
        made.__dict__.update(self.__dict__)
        return made

    @property
    def name(self) -> str:
        """The sound component's name, and what is wrong."""
        return f"{self.sound.name} that {self.says}"


@cache
def _faulty(fault: type[Fault], sound: type) -> type:
    """Return the class of a faulty component; cached, so that equal components have one class."""
    return type(f"{fault.__name__}{sound.__name__}", (fault, sound), {"_sound_class": sound})


def plant(fault: type[F], component: Any) -> F:
    """Return a component with the same parameters and the fault.

    Raises:
        UserError: when there is a fault in it already: a combination of two has no clear meaning. Or when the fault
            replaces a parameter: no copy of the component with another parameter could be made.
    """
    if isinstance(component, Fault):
        raise UserError(f"{component.name!r} has a fault already. Plant each fault in a component without one.")
    replaced = sorted({field.name for field in fields(component)} & (set(dir(fault)) - {"says", *dir(FaultyTask)}))
    if replaced:
        raise UserError(
            f"{fault.__name__} replaces {replaced[0]!r}, a parameter of {component.name!r}. Change parameters with "
            "`with_method` or `with_task` instead."
        )
    kinds: Any = fault, type(component)
    made: F = object.__new__(_faulty(*kinds))
    made.__dict__.update(component.__dict__)
    return made


class FaultyTask(Fault):
    """A task with wrong observations, actions, rewards or levels; a subclass says which."""

    def seen(self, observation: Float[Array, " observation"]) -> Float[Array, " observation"]:
        """Return what the policy sees of an observation."""
        return observation

    def done(self, action: Float[Array, " action"]) -> Float[Array, " action"]:
        """Return the action that is taken."""
        return action

    def paid(self, reward: Float[Array, ""], key: PRNGKeyArray) -> Float[Array, ""]:
        """Return the value that replaces a reward, or a whole episode's fitness."""
        return reward

    def asked(self, level: Int[Array, ""]) -> Int[Array, ""]:
        """Return the level that replaces a requested one."""
        return level

    def reset(self, key: PRNGKeyArray, level: Int[Array, ""]) -> TaskState:
        """Start an episode of the sound task."""
        state: TaskState = self.sound.reset(key, self.asked(level))
        return replace(state, observation=self.seen(state.observation))

    def step(self, state: TaskState, action: Float[Array, " action"]) -> TaskState:
        """Act in the sound task; random numbers follow from the observation, since a step has no key."""
        following: TaskState = self.sound.step(state, self.done(fitting(self.sound, action)))
        bits = jax.lax.bitcast_convert_type(jnp.sum(following.observation) + jnp.sum(action), jnp.uint32)
        return replace(
            following,
            observation=self.seen(following.observation),
            reward=self.paid(following.reward, jax.random.fold_in(jax.random.key(0), bits)),
        )

    def episode(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Run a training episode of the sound task."""
        return self._settled(self.sound.episode(self._between(policy), key, self.asked(level)), key)

    def examine(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Run an examination of the sound task."""
        return self._settled(self.sound.examine(self._between(policy), key, self.asked(level)), key)

    def _between(self, policy: PolicyFn) -> PolicyFn:
        return lambda observation: self.done(fitting(self.sound, policy(self.seen(observation))))

    def _settled(self, episode: Episode, key: PRNGKeyArray) -> Episode:
        return replace(episode, fitness=self.paid(episode.fitness, stream(key, "paid")))


class Blind(FaultyTask):
    """Every observation is 0."""

    says: ClassVar[str] = "shows nothing"

    def seen(self, observation: Float[Array, " observation"]) -> Float[Array, " observation"]:
        """Return zeros."""
        return jnp.zeros_like(observation)


class Paralysed(FaultyTask):
    """Every action is 0."""

    says: ClassVar[str] = "takes no action"

    def done(self, action: Float[Array, " action"]) -> Float[Array, " action"]:
        """Return zeros."""
        return jnp.zeros_like(action)


class PaysNothing(FaultyTask):
    """Every reward is 0."""

    says: ClassVar[str] = "pays nothing"

    def paid(self, reward: Float[Array, ""], key: PRNGKeyArray) -> Float[Array, ""]:
        """Return 0."""
        return jnp.zeros_like(reward)


class ReversesReward(FaultyTask):
    """Every reward has the other sign."""

    says: ClassVar[str] = "reverses rewards"

    def paid(self, reward: Float[Array, ""], key: PRNGKeyArray) -> Float[Array, ""]:
        """Return the negative."""
        return -reward


class PaysAtRandom(FaultyTask):
    """Rewards are drawn from [0, 1)."""

    says: ClassVar[str] = "pays at random"

    def paid(self, reward: Float[Array, ""], key: PRNGKeyArray) -> Float[Array, ""]:
        """Return a random number."""
        return jax.random.uniform(key)


class StaysAtFirstLevel(FaultyTask):
    """Every episode is on the first level."""

    says: ClassVar[str] = "stays at the first level"

    def asked(self, level: Int[Array, ""]) -> Int[Array, ""]:
        """Return 0."""
        return jnp.minimum(level, 0)  # the engine refuses a reset that does not read the level


class IgnoresAnInput(Fault):
    """A circuit whose truth table treats the first input that is ever 1 as 0."""

    says: ClassVar[str] = "ignores an input"

    @property
    def table(self) -> TruthTable:
        """The table, where each row has the targets of the row with that input at 0, if there is one."""
        right: TruthTable = self.sound.table
        first = int(np.argmax(right.inputs.any(axis=0)))
        index = {row.tobytes(): number for number, row in enumerate(right.inputs)}
        without = right.inputs.copy()
        without[:, first] = 0.0
        taken = [index.get(row.tobytes(), number) for number, row in enumerate(without)]
        return replace(right, targets=right.targets[taken])


class HasAWrongRow(Fault):
    """A circuit whose truth table has the opposite targets in the last row of the first level."""

    says: ClassVar[str] = "has a wrong row"

    @property
    def table(self) -> TruthTable:
        """The table with one wrong row."""
        right: TruthTable = self.sound.table
        targets = right.targets.copy()
        targets[right.rows_at_level[0] - 1] ^= True
        return replace(right, targets=targets)


class LearnsNothing(Fault):
    """Every step is discarded."""

    says: ClassVar[str] = "learns nothing"

    def step(self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Any) -> tuple[Any, Progress]:
        """Take a step, but keep the old state."""
        return state, self.sound.step(key, task, level, state)[1]


class Minimizes(Fault):
    """Fitness is minimized instead of maximized."""

    says: ClassVar[str] = "minimizes"

    def step(self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Any) -> tuple[Any, Progress]:
        """Train on the reversed reward."""
        stepped: tuple[Any, Progress] = self.sound.step(key, plant(ReversesReward, task), level, state)
        return stepped


class SelectsAtRandom(Fault):
    """Selection, or the gradient, uses random numbers instead of rewards."""

    says: ClassVar[str] = "selects at random"

    def step(self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Any) -> tuple[Any, Progress]:
        """Train on random rewards."""
        stepped: tuple[Any, Progress] = self.sound.step(key, plant(PaysAtRandom, task), level, state)
        return stepped


class ForgetsChampion(Fault):
    """The untrained policy is judged in the end."""

    says: ClassVar[str] = "forgets its champion"

    def best(self, task: Task, state: Any) -> Policy:
        """Return the policy of an untrained state."""
        policy: Policy = self.sound.best(task, self.sound.init(jax.random.key(0), task))
        return policy


class KeepsItsStepSize(Fault):
    """CMA-ES whose step size never changes."""

    says: ClassVar[str] = "keeps its step size"

    def step(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: CmaEsState
    ) -> tuple[CmaEsState, Progress]:
        """Take a step, and restore the step size."""
        after, progress = self.sound.step(key, task, level, state)
        return replace(after, distribution=after.distribution.replace(std=state.distribution.std)), progress
