"""PPO's training step beside its equations, written anew: what was collected, how good it was, where it moves to."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.pytree import pytree
from evoclaims.envs.base import Episode, PolicyFn, Task, TaskState, fitting, played
from evoclaims.methods.mechanisms.observed import Observed
from evoclaims.methods.ppo import LevelTest, Ppo

MIDDLE: Final = (5.0, -1.0)
"""What is seen in the middle."""
SCALES: Final = (3.0, 0.3)
"""Of what is seen, for each coordinate."""


@dataclass(frozen=True)
class Stroll:
    """A walk on a plane: moving outwards pays in an episode's first half and costs in its second.

    An episode is terminated far from the middle, and truncated at the horizon. Observations have other means and scales
    than 0 and 1.
    """

    name: ClassVar[str] = "stroll"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = Ppo.packages
    levels: ClassVar[int] = 1
    observation_size: ClassVar[int] = 3
    action_size: ClassVar[int] = 2

    horizon: int = 6
    far: float = 2.5

    def reset(self, key: PRNGKeyArray, level: Int[Array, ""]) -> TaskState:
        """Start near the middle."""
        place = jax.random.uniform(key, (2,), minval=-1.0)
        return self._state(place, jnp.zeros((), jnp.int32), jnp.zeros(()))

    def step(self, state: TaskState, action: Float[Array, " action"]) -> TaskState:
        """Move by the action."""
        place, time = state.inner
        reward = self.paid(state.observation, fitting(self, action))
        return self._state(place + action, time + 1, reward)

    def place(self, observation: Float[Array, " 3"]) -> Float[Array, " 2"]:
        """Return where one is."""
        return (observation[:2] - jnp.array(MIDDLE)) / jnp.array(SCALES)

    def paid(self, observation: Float[Array, " 3"], action: Float[Array, " 2"]) -> Float[Array, ""]:
        """Return the reward of an action after an observation."""
        return jnp.dot(self.place(observation), action) * (1 - 2 * observation[2])

    def episode(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Walk once."""
        return Episode(fitness=played(self, policy, self.reset(key, level))[1], success=jnp.zeros(()))

    def examine(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Walk once."""
        return self.episode(policy, key, level)

    def _state(self, place: Float[Array, " 2"], time: Int[Array, ""], reward: Float[Array, ""]) -> TaskState:
        late = (time >= self.horizon // 2).astype(jnp.float32)
        shown = jnp.append(place * jnp.array(SCALES) + jnp.array(MIDDLE), late)
        terminated = jnp.linalg.norm(place) > self.far
        return TaskState(shown, reward, terminated, ~terminated & (time >= self.horizon), (place, time))


@pytree
class Batch:
    """What a step trains on, [trajectories, time, …].

    Attributes:
        observation, following: before and after each action, whitened.
        raw: actions before tanh.
        log_density: of the actions, when they were taken.
        reward: scaled.
        terminated, truncated: 1 where an episode ended.
    """

    observation: Float[Array, "n time observation"]
    following: Float[Array, "n time observation"]
    raw: Float[Array, "n time action"]
    log_density: Float[Array, "n time"]
    reward: Float[Array, "n time"]
    terminated: Float[Array, "n time"]
    truncated: Float[Array, "n time"]


@dataclass(frozen=True)
class PpoMechanisms(Observed):
    """PPO whose step is taken again by the equations of its papers, on what the step collects.

    The advantage is that of Brax: r + γ v' - V, where v' = V' + A(λ) is the next state's λ-return (Espeholt et al.
    2018, eq. 1 and §4.2, with ρ = c = 1); Schulman's (2016, eq. 16) has γλ A(λ) where this has γ A(λ). Truncated steps
    have none. The loss is the clipped surrogate (Schulman et al. 2017, eq. 7 and 9) of advantages that are normalized
    in each minibatch, with a quarter of the squared error of the value; Adam is Kingma and Ba's (2015, algorithm 1).

    Metrics:

    * "recorded": the share of transitions whose reward, density, end and next observation are right.
    * "whitened": 1 if mean and spread of observations are those of all that were collected, else 0.
    * "divided": 1 if each pass has every trajectory in one minibatch, else 0.
    * "alike": the largest correlation of a pass's order with that of the trajectories or the pass before.
    * "aligned": the correlation of advantages with what the step adds to the logarithms of their actions' densities.
    * "clipped": the share of actions whose density has left the bounds after the step.
    * "policy_error", "value_error": how far the step of a network ends from where the equations lead, as a share of
      their step.
    """

    of: Ppo = Ppo(
        policy_layers=(4,),
        value_layers=(),
        environments=256,
        unroll_length=4,
        batch_size=256,
        minibatches=4,
        updates_per_batch=2,
        discounting=0.9,
        learning_rate=0.02,
        entropy_cost=0.1,
        reward_scaling=2.0,
        gae_lambda=0.8,
        clipping=0.2,
        normalize_observations=True,
        level_test=LevelTest(every=0),
    )

    def seen(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], before: Any, after: Any
    ) -> Mapping[str, Float[Array, ""]]:
        """Collect the same, and take the step again."""
        assert isinstance(task, Stroll)
        _, data = self.of.collected(key, task, level, before)
        mean, spread = _whitening(before.statistics, data.observation)
        extras = data.extras["policy_extras"]
        batch = Batch(
            observation=_each(lambda x: (x - mean) / spread)(data.observation),
            following=_each(lambda x: (x - mean) / spread)(data.next_observation),
            raw=extras["raw_action"],
            log_density=extras["log_prob"],
            reward=data.reward * self.of.reward_scaling,
            terminated=1 - data.discount,
            truncated=data.extras["state_extras"]["truncation"],
        )
        orders = jax.vmap(self.of.division)(self.of.pass_keys(key))
        networks = self._trained(batch, orders.reshape(-1, self.of.batch_size), before)
        density = _each(lambda network, x, raw: _log_density(raw, *_normal(_layers(network, x))), (None, 0, 0))
        older, newer = (density(one.policy, batch.observation, batch.raw) for one in (before.networks, after.networks))
        advantage, _ = self._advantages(before.networks.value, batch)
        old = before.statistics
        shown = _each(lambda x: (x - old.mean) / old.std)(data.observation)
        taken = density(before.networks.policy, shown, batch.raw) / batch.log_density
        missed = [jnp.abs(after.statistics.mean - mean), jnp.abs(after.statistics.std - spread)]
        whole = jnp.sort(orders.reshape(orders.shape[0], -1), axis=1) == jnp.arange(data.reward.shape[0])[None]
        left = jnp.abs(jnp.exp(newer - batch.log_density) - 1) > self.of.clipping
        return {
            "recorded": jnp.mean(
                (_each(_right(task))(data) & _connected(data) & (jnp.abs(taken - 1) < 0.01)).astype(jnp.float32)
            ),
            "whitened": jnp.all(jnp.stack(missed) < 1e-3 * spread[None]).astype(jnp.float32),
            "divided": jnp.all(whole).astype(jnp.float32),
            "alike": _alike(orders),
            "aligned": _correlation(advantage, newer - older),
            "clipped": jnp.mean(left.astype(jnp.float32)),
            "policy_error": _error(before.networks.policy, after.networks.policy, networks.policy),
            "value_error": _error(before.networks.value, after.networks.value, networks.value),
        }

    def _trained(self, batch: Batch, orders: Int[Array, "updates batch"], state: Any) -> Any:
        """Return the networks after a step with these minibatches."""
        rate = self.of.learning_rate

        def descend(carry: tuple[Any, Any, Any, Array], chosen: Int[Array, " batch"]) -> tuple[Any, None]:
            networks, first, second, count = carry
            gradient = jax.grad(self._loss)(networks, jax.tree.map(lambda leaf: leaf[chosen], batch))
            count = count + 1
            first = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, first, gradient)
            second = jax.tree.map(lambda v, g: 0.999 * v + 0.001 * g**2, second, gradient)

            def moved(x: Array, m: Array, v: Array) -> Array:
                return x - rate * (m / (1 - 0.9**count)) / (jnp.sqrt(v / (1 - 0.999**count)) + 1e-8)

            return (jax.tree.map(moved, networks, first, second), first, second, count), None

        moments = state.optimizer[0]
        start = state.networks, moments.mu, moments.nu, moments.count.astype(jnp.float32)
        return jax.lax.scan(descend, start, orders)[0][0]

    def _loss(self, networks: Any, rows: Batch) -> Float[Array, ""]:
        """Return the clipped surrogate, the value's error and the entropy, as one number."""
        advantage, error = self._advantages(networks.value, rows)
        advantage = jax.lax.stop_gradient(advantage - jnp.mean(advantage)) / jax.lax.stop_gradient(jnp.std(advantage))
        output = _each(_layers, (None, 0))(networks.policy, rows.observation)
        ratio = jnp.exp(_each(lambda raw, out: _log_density(raw, *_normal(out)))(rows.raw, output) - rows.log_density)
        clipped = jnp.minimum(jnp.maximum(ratio, 1 - self.of.clipping), 1 + self.of.clipping)
        surrogate = jnp.mean(jnp.minimum(ratio * advantage, clipped * advantage))
        entropy = jnp.mean(_each(lambda out: _entropy(*_normal(out)))(output))
        return jnp.mean(error**2) / 4 - surrogate - self.of.entropy_cost * entropy

    def _advantages(self, value: Any, rows: Batch) -> tuple[Float[Array, "n time"], Float[Array, "n time"]]:
        """Return advantages, and by how much values miss their targets, step by step from the end."""
        discount, trace = self.of.discounting, self.of.gae_lambda
        values = _each(_layers, (None, 0))(value, rows.observation)[..., 0]
        ahead = jax.vmap(_layers, (None, 0))(value, rows.following[:, -1])[:, 0]
        found, beyond = [], jnp.zeros_like(ahead)  # the next state's return, less its value
        for time in reversed(range(values.shape[1])):
            counts, goes_on = 1 - rows.truncated[:, time], discount * (1 - rows.terminated[:, time])
            step = rows.reward[:, time] + goes_on * ahead - values[:, time]
            advantage = counts * (step + goes_on * beyond)
            ahead, beyond = values[:, time], counts * (step + trace * goes_on * beyond)
            found.append((advantage, jax.lax.stop_gradient(ahead + beyond) - ahead))
        advantages, errors = zip(*reversed(found), strict=True)
        return jnp.stack(advantages, axis=1), jnp.stack(errors, axis=1)


def _each(function: Callable[..., Any], axes: Any = 0) -> Callable[..., Any]:
    return jax.vmap(jax.vmap(function, axes), axes)


def _right(task: Stroll) -> Callable[[Any], Bool[Array, ""]]:
    """Return what says whether a transition is what the task does after an action."""

    def right(step: Any) -> Bool[Array, ""]:
        place, following = task.place(step.observation), task.place(step.next_observation)
        beyond = jnp.linalg.norm(following) - task.far
        acted = jnp.max(jnp.abs(step.action - jnp.tanh(step.extras["policy_extras"]["raw_action"]))) < 1e-5
        moved = jnp.max(jnp.abs(place + step.action - following)) < 1e-4
        paid = jnp.abs(jnp.dot(place, step.action) * (1 - 2 * step.observation[2]) - step.reward) < 1e-4
        ends: Array = ((beyond > 0) == (step.discount == 0)) | (jnp.abs(beyond) < 1e-4)
        return ends & acted & moved & paid

    return right


def _connected(data: Any) -> Bool[Array, "n time"]:
    """Return which transitions are followed by their next observation, where the episode goes on."""
    ended = (data.discount == 0) | (data.extras["state_extras"]["truncation"] == 1)
    same = jnp.all(data.next_observation[:, :-1] == data.observation[:, 1:], axis=-1)
    return jnp.pad(same | ended[:, :-1], ((0, 0), (0, 1)), constant_values=True)


def _whitening(earlier: Any, observation: Float[Array, "n time size"]) -> tuple[Float[Array, " size"], ...]:
    """Return mean and standard deviation of all observations, earlier ones by their count, mean and sum of squares."""
    fresh = observation.reshape(-1, observation.shape[-1])
    count = earlier.count.lo.astype(jnp.float32)
    total = count + fresh.shape[0]
    mean = (count * earlier.mean + jnp.sum(fresh, axis=0)) / total
    squares = count * (earlier.mean - mean) ** 2 + jnp.sum((fresh - mean[None]) ** 2, axis=0)
    return mean, jnp.sqrt((earlier.summed_variance + squares) / total)


def _alike(orders: Int[Array, "passes minibatches batch"]) -> Float[Array, ""]:
    """Return the largest correlation of a pass's order with the trajectories' own or the one before."""
    rows = orders.reshape(orders.shape[0], -1).astype(jnp.float32)
    earlier = jnp.concatenate([jnp.arange(rows.shape[1], dtype=jnp.float32)[None], rows[:-1]])
    straight = jnp.broadcast_to(earlier[0], rows.shape)
    return jnp.max(jnp.abs(jax.vmap(_correlation)(jnp.concatenate([rows, rows]), jnp.concatenate([earlier, straight]))))


def _layers(network: Any, x: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
    """Return the outputs of swish layers and a linear one."""
    layers = network["params"]
    for place in range(len(layers)):
        if place:
            x = x / (1 + jnp.exp(-x))
        x = x @ layers[f"hidden_{place}"]["kernel"] + layers[f"hidden_{place}"]["bias"]
    return x


def _normal(output: Float[Array, " doubled"]) -> tuple[Float[Array, " action"], Float[Array, " action"]]:
    """Return mean and standard deviation of raw actions."""
    middle, spread = jnp.split(output, 2)
    return middle, jnp.log1p(jnp.exp(spread)) + 0.001


def _log_density(
    raw: Float[Array, " action"], middle: Float[Array, " action"], spread: Float[Array, " action"]
) -> Float[Array, ""]:
    normal = -(((raw - middle) / spread) ** 2) / 2 - jnp.log(spread) - math.log(2 * math.pi) / 2
    return jnp.sum(normal - _log_slope(raw))


def _log_slope(raw: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Return the logarithm of tanh's derivative, also where cosh is beyond float32."""
    far = jnp.abs(raw) > 20  # there, cosh is half of exp to the last bit
    return jnp.where(far, 2 * math.log(2) - 2 * jnp.abs(raw), -2 * jnp.log(jnp.cosh(jnp.where(far, 0.0, raw))))


def _entropy(middle: Float[Array, " action"], spread: Float[Array, " action"]) -> Float[Array, ""]:
    """Return the entropy of tanh of normal numbers by Gauss and Hermite's rule; Brax estimates it from one draw."""
    points, weights = np.polynomial.hermite_e.hermegauss(16)
    slopes = _log_slope(middle[:, None] + jnp.outer(spread, jnp.asarray(points, jnp.float32)))
    normal = 0.5 + math.log(2 * math.pi) / 2 + jnp.log(spread)
    return jnp.sum(normal + slopes @ jnp.asarray(weights / weights.sum(), jnp.float32))


def _correlation(one: Float[Array, "*n"], other: Float[Array, "*n"]) -> Float[Array, ""]:
    """Return Pearson's correlation; 0 where one does not vary."""
    one, other = one - jnp.mean(one), other - jnp.mean(other)
    return jnp.sum(one * other) / jnp.sqrt(jnp.maximum(jnp.sum(one**2) * jnp.sum(other**2), 1e-30))


def _error(start: Any, end: Any, right: Any) -> Float[Array, ""]:
    """Return how far a step ends from the right place, as a share of the right step."""
    missed, gone = (jax.tree.map(jnp.subtract, right, one) for one in (end, start))
    lengths = [jnp.sqrt(sum(jnp.sum(leaf**2) for leaf in jax.tree.leaves(tree))) for tree in (missed, gone)]
    return lengths[0] / jnp.maximum(lengths[1], 1e-8)
