"""PPO (Schulman et al. 2017, arXiv:1707.06347): Brax's networks, loss and running statistics in our own loop.

Brax's `ppo.train` drives the device from the host and trains one agent. Here one training step is a pure function, so
that the engine can run many trials in one program and raise the curriculum's level on the device.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray

from evoclaims.core.errors import UserError, require_at_least
from evoclaims.core.foreign import Later, implicit_promotions
from evoclaims.core.keys import stream, streams
from evoclaims.core.pytree import pytree, select, strong
from evoclaims.envs.base import Episode, Task, share
from evoclaims.methods.base import Policy, Progress
from evoclaims.methods.collect import Act, Interaction, collect, losses, networks, running_statistics, specs

optax = Later("optax")


@pytree
class PpoState:
    """Networks, optimizer, observation statistics and the environments being interacted with."""

    networks: Any
    optimizer: Any
    statistics: Any
    interaction: Interaction
    steps: Int[Array, ""]


@dataclass(frozen=True)
class LevelTest:
    """When and how PPO's policy is tested for moving up a level.

    Attributes:
        every: training steps between tests. 0 means no tests: the trial stays on its level, and its reported fitness is
            the mean training reward times the horizon. For one-level tasks with long episodes.
        sampled_episodes: 0 tests the deterministic policy with the task's own examination; otherwise, how many training
            episodes of the *stochastic* policy must all be without error (the authors' published code asks 128 of its
            deterministic policy). Such an episode is one step, on a row drawn from the level.
    """

    every: int = 1
    sampled_episodes: int = 0

    def __post_init__(self) -> None:
        """Check the counts."""
        require_at_least(0, "The level test's", every=self.every, sampled_episodes=self.sampled_episodes)


@dataclass(frozen=True)
class Ppo:
    """Clipped-surrogate policy gradient; the defaults are the paper's table for the stepping gates (§A.4).

    Attributes:
        policy_layers: widths of the policy's hidden layers (swish).
        value_layers: widths of the value network's hidden layers; the paper gives none, the published code has 7 × 32
            on the gates, and with robots 5 × 256.
        environments: episodes run in parallel.
        unroll_length: steps of each environment in one trajectory.
        batch_size: trajectories per minibatch.
        minibatches: minibatches per pass.
        updates_per_batch: passes over the collected data.
        discounting, learning_rate, entropy_cost, reward_scaling, gae_lambda, clipping: as in Brax.
        normalize_observations: whether running statistics whiten the observation.
        level_test: the test for moving up a level.
    """

    name: ClassVar[str] = "ppo"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ("brax", "flax", "optax")

    policy_layers: tuple[int, ...] = (4,) * 6
    value_layers: tuple[int, ...] = (32,) * 7
    environments: int = 4096
    unroll_length: int = 1
    batch_size: int = 2048
    minibatches: int = 32
    updates_per_batch: int = 4
    discounting: float = 1.0
    learning_rate: float = 3e-4
    entropy_cost: float = 1e-2
    reward_scaling: float = 1.0
    gae_lambda: float = 0.95
    clipping: float = 0.3
    normalize_observations: bool = False
    level_test: LevelTest = LevelTest()

    def __post_init__(self) -> None:
        """Check the sizes, and that the collected data fills the minibatches."""
        sizes = ("environments", "unroll_length", "batch_size", "minibatches", "updates_per_batch")
        require_at_least(1, "PPO's", **{name: getattr(self, name) for name in sizes})
        if any(width < 1 for width in (*self.policy_layers, *self.value_layers)):
            raise UserError(
                f"PPO has policy_layers={self.policy_layers} and value_layers={self.value_layers}. Write at least 1 "
                "neuron for each layer."
            )
        if self.batch_size * self.minibatches % self.environments:
            raise UserError(
                f"PPO has batch_size={self.batch_size}, minibatches={self.minibatches} and "
                f"environments={self.environments}. Write numbers for which batch_size × minibatches is a multiple "
                "of environments."
            )

    def init(self, key: PRNGKeyArray, task: Task) -> PpoState:
        """Draw the networks' parameters and start the environments at level 0.

        Raises:
            UserError: when the level test samples episodes, but those of `task` are longer than a step, or their reward
                does not say whether the step was faultless.
        """
        if self.level_test.sampled_episodes and task.horizon > 1:
            raise UserError(
                f"PPO's level test by sampled episodes plays one step of each, but an episode of {task.name} has up "
                f"to {task.horizon} steps, so the first one would decide alone. Let the task draw one row per "
                "episode (sampling='sampled'), or test the deterministic policy on the whole table "
                "(sampled_episodes=0)."
            )
        if self.level_test.sampled_episodes and not getattr(task, "errors_cost", False):
            raise UserError(
                "PPO's level test by sampled episodes takes a reward of at least 0 for a step without error, and "
                f"nothing says that {task.name} pays so. Write `errors_cost: ClassVar[bool] = True` in it if exactly "
                "an error's reward is below 0, or test the deterministic policy (sampled_episodes=0)."
            )
        policy_key, value_key, reset_key = streams(key, "policy", "value", "reset")
        net = self._networks(task)
        parameters = losses.PPONetworkParams(
            policy=net.policy_network.init(policy_key), value=net.value_network.init(value_key)
        )
        statistics = running_statistics.init_state(specs.Array((task.observation_size,), jnp.dtype("float32")))
        return strong(
            PpoState(
                networks=parameters,
                optimizer=optax.adam(self.learning_rate).init(parameters),
                statistics=statistics,
                interaction=Interaction.start(task, reset_key, jnp.zeros((), jnp.int32), self.environments),
                steps=jnp.zeros((), jnp.int32),
            )
        )

    def step(self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: PpoState) -> tuple[PpoState, Progress]:
        """Collect batch_size × minibatches trajectories, then train on them in updates_per_batch passes."""
        interaction, data = self.collected(key, task, level, state)
        statistics = state.statistics
        if self.normalize_observations:
            with implicit_promotions():
                statistics = running_statistics.update(statistics, data.observation)
        parameters, optimizer = self._train(key, task, data, statistics, state.networks, state.optimizer)
        after = strong(
            PpoState(
                networks=parameters,
                optimizer=optimizer,
                statistics=statistics,
                interaction=interaction,
                steps=state.steps + 1,
            )
        )
        if self.level_test.every:
            tested = self._test(stream(key, "test"), task, level, after)
        else:
            tested = Episode(fitness=jnp.mean(data.reward) * task.horizon, success=jnp.zeros(()))
        # A policy with NaN parameters can still have a finite fitness: check the parameters themselves.
        finite = jax.tree.map(lambda leaf: jnp.all(jnp.isfinite(leaf)), parameters)
        return after, Progress(
            fitness=tested.fitness,
            success=tested.success,
            healthy=jnp.all(jnp.stack(jax.tree.leaves(finite))),
            metrics={"training_reward": jnp.mean(data.reward)},
        )

    def collected(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: PpoState
    ) -> tuple[Interaction, Any]:
        """Return what a step with this key collects: the episodes afterwards, and transitions as `collect` has them."""
        reset_key, act_key = streams(key, "reset", "act")
        interaction = state.interaction.at_level(task, reset_key, self.trained_level(level))
        rounds = self.batch_size * self.minibatches // self.environments
        return collect(task, self._act(task, state), act_key, interaction, rounds, self.unroll_length)

    def pass_keys(self, key: PRNGKeyArray) -> PRNGKeyArray:
        """Return the keys of the passes over what a step with this key has collected."""
        return jax.random.split(stream(key, "train"), self.updates_per_batch)

    def division(self, key: PRNGKeyArray) -> Int[Array, "minibatches batch"]:
        """Return the trajectories of each minibatch, from a pass's key."""
        order = jax.random.permutation(stream(key, "order"), self.batch_size * self.minibatches)
        return order.reshape(self.minibatches, self.batch_size)

    def trained_level(self, level: Int[Array, ""]) -> Int[Array, ""]:
        """Return the level that a trial at `level` trains on: that one."""
        return level

    def best(self, task: Task, state: PpoState) -> Policy:
        """Return the current deterministic policy."""
        make = networks.make_inference_fn(self._networks(task))

        def function(parameters: Any, observation: Float[Array, " observation"]) -> Float[Array, " action"]:
            with implicit_promotions():
                action: Array = make(parameters, deterministic=True)(observation, jax.random.key(0))[0]
            return action

        return Policy(parameters=(state.statistics, state.networks.policy), function=function)

    @property
    def tested_every(self) -> int:
        """Training steps from one test to the next; 0: there are none."""
        return self.level_test.every

    def cost(self, task: Task) -> int:
        """Return the environment steps collected in one training step."""
        return self.batch_size * self.minibatches * self.unroll_length

    def _networks(self, task: Task) -> Any:
        """Build Brax's policy and value networks for the task's sizes."""
        return networks.make_ppo_networks(
            task.observation_size,
            task.action_size,
            **({"preprocess_observations_fn": running_statistics.normalize} if self.normalize_observations else {}),
            policy_hidden_layer_sizes=self.policy_layers,
            value_hidden_layer_sizes=self.value_layers,
        )

    def _act(self, task: Task, state: PpoState) -> Act:
        act = networks.make_inference_fn(self._networks(task))((state.statistics, state.networks.policy))

        def function(observation: Array, key: Array) -> tuple[Array, Any]:
            with implicit_promotions():
                acted: tuple[Array, Any] = act(observation, key)
            return acted

        return function

    def _train(
        self, key: PRNGKeyArray, task: Task, data: Any, statistics: Any, parameters: Any, optimizer: Any
    ) -> tuple[Any, Any]:
        """Run updates_per_batch passes of stochastic gradient descent over `data` (leaves [trajectories, time, …])."""
        loss = partial(
            losses.compute_ppo_loss,
            ppo_network=self._networks(task),
            entropy_cost=self.entropy_cost,
            discounting=self.discounting,
            reward_scaling=self.reward_scaling,
            gae_lambda=self.gae_lambda,
            clipping_epsilon=self.clipping,
        )
        adam = optax.adam(self.learning_rate)

        def descend(carry: tuple[Any, Any], minibatch: tuple[Array, Array]) -> tuple[tuple[Any, Any], None]:
            parameters, optimizer = carry
            chosen, loss_key = minibatch
            # Gathering rows per minibatch moves each row once; the order is drawn once for all leaves.
            rows = jax.tree.map(lambda leaf: jnp.take(leaf, chosen, axis=0), data)
            with implicit_promotions():
                gradient, _ = jax.grad(loss, has_aux=True)(parameters, statistics, rows, loss_key)
                update, optimizer = adam.update(gradient, optimizer)
            return (optax.apply_updates(parameters, update), optimizer), None

        def one_pass(carry: tuple[Any, Any], pass_key: Array) -> tuple[tuple[Any, Any], None]:
            loss_keys = jax.random.split(stream(pass_key, "loss"), self.minibatches)
            return jax.lax.scan(descend, carry, (self.division(pass_key), loss_keys))

        (parameters, optimizer), _ = jax.lax.scan(one_pass, (parameters, optimizer), self.pass_keys(key))
        return parameters, optimizer

    def _test(self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: PpoState) -> Episode:
        """Test the policy on the current level; between tests, success is 0, so the level stays."""
        examined = task.examine(self.best(task, state), stream(key, "examination"), level)
        success = examined.success
        if self.level_test.sampled_episodes:
            act = self._act(task, state)
            keys = jax.random.split(stream(key, "sampled test"), self.level_test.sampled_episodes)

            def rewarded(key: Array) -> Array:
                reset_key, act_key = streams(key, "reset", "act")
                start = task.reset(reset_key, level)
                return task.step(start, act(start.observation, act_key)[0]).reward

            faultless = jax.vmap(rewarded)(keys) >= 0
            success = share(jnp.sum(faultless), jnp.asarray(faultless.size))
        due = state.steps % self.level_test.every == 0
        return select(
            due,
            Episode(fitness=examined.fitness, success=success),
            Episode(fitness=examined.fitness, success=jnp.zeros_like(success)),
        )
