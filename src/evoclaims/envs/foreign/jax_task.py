"""The base of tasks made of other libraries' environments in jax, which every method trains on."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray
from numpy.typing import NDArray

from evoclaims.core.errors import UserError, require_at_least
from evoclaims.core.foreign import implicit_promotions
from evoclaims.core.keys import EVALUATION, streams, trial_key
from evoclaims.core.pytree import pytree, select, strong
from evoclaims.envs.base import Episode, PolicyFn, TaskState, averaged, fitting, played
from evoclaims.envs.foreign.native_actions import array_action, choice
from evoclaims.envs.foreign.scoring import ForeignTask, Scored


@dataclass(frozen=True)
class Choice:
    """One of `size` actions: that of the largest number."""

    size: int

    def chosen(self, numbers: Float[Array, " action"]) -> Int[Array, ""]:
        """Return the action's index."""
        return jnp.argmax(numbers).astype(jnp.int32)


@dataclass(frozen=True)
class Range:
    """An array of numbers, each in a range: -1 is the lowest, 1 the highest, and beyond these is clipped.

    A number without bounds is taken as it is.

    Attributes:
        low, high: bounds of each number.
        shape: of the array.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """How many numbers there are."""
        return len(self.low)

    def chosen(self, numbers: Float[Array, " action"]) -> Float[Array, ...]:
        """Return the array."""
        low, high = np.asarray(self.low, np.float32), np.asarray(self.high, np.float32)
        bounded = np.isfinite(low) & np.isfinite(high)
        base, width = np.where(bounded, low, 0.0), np.where(bounded, high - low, 0.0)
        scaled = base + (jnp.clip(numbers, -1.0, 1.0) + 1.0) * width / 2.0
        return jnp.where(bounded, scaled, numbers).astype(jnp.float32).reshape(self.shape)


def actions_of(space: Any, what: str) -> Choice | Range:
    """Return how actions of a space, Gymnasium's or gymnax's, are chosen.

    Raises:
        UserError: for spaces that are neither a choice nor an array.
    """
    if hasattr(space, "n") and space.shape == () and getattr(space, "start", 0) == 0:
        return Choice(int(space.n))
    if hasattr(space, "low") and hasattr(space, "high"):
        low, high = (np.broadcast_to(np.asarray(x, np.float64), space.shape) for x in (space.low, space.high))
        return Range(tuple(map(float, low.ravel())), tuple(map(float, high.ravel())), tuple(space.shape))
    raise UserError(
        f"The actions of {what} are a {type(space).__name__}, which no policy can choose here. Use an environment "
        "whose actions are Discrete or a Box."
    )


@pytree
class Moment:
    """What an environment is at after a step.

    Attributes:
        state: its own.
        observation: its own, of any shape.
        reward: of the step.
        terminated: whether it has ended the episode.
        truncated: whether the episode is over without an end, by a limit of its own.
    """

    state: Any
    observation: Array
    reward: Float[Array, ""]
    terminated: Bool[Array, ""]
    truncated: Bool[Array, ""] = field(default_factory=lambda: jnp.zeros((), bool))


@pytree
class Inner:
    """The inner state of an episode.

    Attributes:
        state: the environment's own.
        key: data of the key that the next step's key derives from; keys themselves are no arrays.
        time: environment steps made.
        worst: the lowest reward so far, or 0 if none was below.
        sound: whether all numbers were finite.
    """

    state: Any
    key: Array
    time: Int[Array, ""]
    worst: Float[Array, ""]
    sound: Bool[Array, ""]


@dataclass(frozen=True)
class Descriptor:
    """What MAP-Elites maps an episode by: two numbers of its last observation.

    Attributes:
        places: of the two in the observation, counted from 0.
        area: lowest and highest value of the first, and of the second.
    """

    places: tuple[int, int]
    area: tuple[tuple[float, float], tuple[float, float]]

    def __post_init__(self) -> None:
        """Reject places that are none, and an area without room."""
        if len(self.places) != 2 or not all(isinstance(place, int) and place >= 0 for place in self.places):
            raise UserError(
                f"A descriptor has places={self.places!r}. Write two positions in the observation, counted from 0, "
                "such as (0, 1)."
            )
        if len(self.area) != 2:
            raise UserError(f"A descriptor has area={self.area!r}. Write two ranges, such as ((-1, 1), (-1, 1)).")
        for lowest, highest in self.area:
            if not (math.isfinite(lowest) and math.isfinite(highest) and lowest < highest):
                raise UserError(
                    f"A descriptor's area has the range ({lowest}, {highest}). Write two finite "
                    "numbers, the lower one first."
                )


@dataclass(frozen=True, kw_only=True)
class JaxTask(ForeignTask):
    """An environment in jax. A subclass has revision, `make`, `begin`, `advance` and `actions`.

    A step after which a number is not finite is undone, and the episode ends, unsolved. If it had rewards below 0, it
    is paid the lowest of them for each step that it lacks, else nothing: to break an environment pays no more than its
    worst step so far. After an action that is NaN the reward is NaN, and so is the return.

    Attributes:
        episode_steps: environment steps after which an episode is truncated.
        descriptor: needed by MAP-Elites alone.
    """

    episode_steps: int = 1000
    descriptor: Descriptor | None = None

    def __post_init__(self) -> None:
        """Check the counts."""
        super().__post_init__()
        require_at_least(1, f"{self.name}'s", episode_steps=self.episode_steps)

    @property
    @abstractmethod
    def revision(self) -> int:
        """Increased whenever the task's results change."""

    @abstractmethod
    def make(self) -> Any:
        """Return the library's environment."""

    @property
    @abstractmethod
    def actions(self) -> Choice | Range:
        """How actions are chosen."""

    @abstractmethod
    def begin(self, key: PRNGKeyArray) -> Moment:
        """Start an episode."""

    @abstractmethod
    def advance(self, key: PRNGKeyArray, state: Any, action: Array) -> Moment:
        """Act once, by an action of the environment's own."""

    @property
    def threshold(self) -> float:
        """The return that solves an episode, less a millionth of it: returns are summed in 32 bits."""
        wanted = super().threshold
        return wanted - 1e-6 * abs(wanted) if math.isfinite(wanted) else wanted

    @property
    def horizon(self) -> int:
        """Environment steps of the longest episode."""
        return self.episode_steps

    @property
    def action_size(self) -> int:
        """How many numbers choose an action."""
        return self.actions.size

    @cached_property
    def observation_size(self) -> int:
        """How many numbers an observation has."""
        return int(jax.eval_shape(lambda: self.reset(jax.random.key(0), jnp.zeros((), jnp.int32))).observation.size)

    def reset(self, key: PRNGKeyArray, level: Int[Array, ""]) -> TaskState:
        """Start an episode."""
        begin_key, later_key = streams(key, "begin", "later")
        with implicit_promotions():
            moment = self.begin(begin_key)
        no = jnp.zeros((), bool)
        time, key_data = jnp.zeros((), jnp.int32), jax.random.key_data(later_key)
        inner = Inner(state=moment.state, key=key_data, time=time, worst=jnp.zeros(()), sound=~no)
        return TaskState(
            observation=_flat(moment.observation),
            reward=jnp.zeros(()),
            terminated=no,
            truncated=no,
            inner=strong(inner),
        )

    def step(self, state: TaskState, action: Float[Array, " action"]) -> TaskState:
        """Act once."""
        inner: Inner = state.inner
        step_key, later_key = streams(jax.random.wrap_key_data(inner.key), "step", "later")
        numbers = fitting(self, action)
        with implicit_promotions():
            found = self.advance(step_key, inner.state, self.actions.chosen(numbers))
        moment, sound = self._ruled(found, inner.time + 1, inner.worst, jnp.any(jnp.isnan(numbers)))
        reached = strong(
            Inner(
                state=select(sound, moment.state, inner.state),
                key=jax.random.key_data(later_key),
                time=inner.time + 1,
                worst=jnp.minimum(inner.worst, moment.reward),
                sound=sound,
            )
        )
        return TaskState(
            observation=jnp.where(sound, _flat(moment.observation), state.observation),
            reward=moment.reward,
            terminated=moment.terminated,
            truncated=moment.truncated,
            inner=reached,
        )

    def _ruled(
        self, moment: Moment, steps: Int[Array, ""], worst: Float[Array, ""], lost: Bool[Array, ""]
    ) -> tuple[Moment, Bool[Array, ""]]:
        """Return what counts of the moment after some steps, and whether its numbers are finite.

        `worst` is that of the steps before. Where the policy was `lost`, its action was no number.

        Each examination follows this rule, so that a policy scores the same whatever has trained it.
        """
        sound = jnp.all(jnp.isfinite(_flat(moment.observation))) & jnp.isfinite(moment.reward) & ~lost
        terminated = moment.terminated | ~sound
        truncated = (moment.truncated | (steps >= self.episode_steps)) & ~terminated
        instead = jnp.where(lost, jnp.nan, worst * (self.episode_steps + 1 - steps).astype(jnp.float32))
        reward = jnp.where(sound, moment.reward, instead)
        return replace(moment, reward=reward, terminated=terminated, truncated=truncated), sound

    def episode(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Run one episode: fitness is its return, success whether that is `solved_at` or more."""
        state, total, _ = played(self, policy, self.reset(key, level))
        metrics = {"episode_steps": state.inner.time.astype(jnp.float32)}
        if self.descriptor is not None:
            if max(self.descriptor.places) >= state.observation.size:  # jax would take the last number instead
                raise UserError(
                    f"{self.name}'s descriptor reads the places {self.descriptor.places} of its observation, which "
                    f"has {state.observation.size} numbers. Write places from 0 to {state.observation.size - 1}."
                )
            metrics |= {name: state.observation[at] for name, at in zip("xy", self.descriptor.places, strict=True)}
        solved = (total >= self.threshold) & state.inner.sound
        return Episode(fitness=total, success=solved.astype(jnp.float32), metrics=metrics)

    def examine(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Run `examined_episodes` from different starts and average; success is the share that is solved."""
        keys = jax.random.split(key, self.examined_episodes)
        episodes: Episode = jax.vmap(lambda k: self.episode(policy, k, level))(keys)
        return averaged(episodes)

    @property
    def area(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """What MAP-Elites maps; raises a `UserError` where it is not declared."""
        if self.descriptor is None:
            raise UserError(
                f"MAP-Elites maps how episodes end, and {self.name} has no descriptor of this. Add one, "
                "such as descriptor=Descriptor(places=(0, 1), area=((-1, 1), (-1, 1)))."
            )
        return self.descriptor.area

    def reachable(self, cells: tuple[int, int]) -> NDArray[np.bool_]:
        """Return that any cell may be reached: nobody knows."""
        return np.ones(cells, bool)

    def examine_natively(self, policy: Callable[[Any], Any], seed: int) -> Scored:
        """Run `examined_episodes` of a policy that acts as the environment wants it, on the host, and average."""
        begin, actions = jax.jit(self.begin), self.actions

        def native(action: Any) -> Any:
            if isinstance(actions, Choice):
                return choice(action, 0, actions.size, self.name)
            return array_action(actions.shape, action, self.name)

        @jax.jit
        def advance(key: Array, state: Any, action: Array, steps: Array, worst: Array) -> tuple[Moment, Array]:
            return self._ruled(self.advance(key, state, action), steps, worst, jnp.any(jnp.isnan(action)))

        def one(key: Array) -> tuple[float, int, bool]:
            key, begin_key = jax.random.split(key)
            moment, total, worst = begin(begin_key), np.float32(0.0), np.float32(0.0)
            for step in count(1):
                key, step_key = jax.random.split(key)
                action = jnp.asarray(native(policy(np.asarray(moment.observation))))
                moment, sound = advance(step_key, moment.state, action, np.int32(step), worst)
                total += np.float32(moment.reward)
                worst = min(worst, np.float32(moment.reward))
                if moment.terminated or moment.truncated:
                    break
            return float(total), step, bool(sound)

        with implicit_promotions():
            return self.scores(map(one, jax.random.split(trial_key(seed, EVALUATION), self.examined_episodes)))

    @cached_property
    def _made(self) -> Any:
        with jax.ensure_compile_time_eval():  # its arrays are numbers, also where a function is being traced
            return self.make()


def _flat(observation: Array) -> Float[Array, " observation"]:
    return jnp.ravel(jnp.asarray(observation)).astype(jnp.float32)
