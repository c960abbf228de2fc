"""Evaluating populations of flat parameter vectors, and keeping the best one seen."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.pytree import pytree, select
from evoclaims.envs.base import Episode, PolicyFn, Task
from evoclaims.methods.base import Policy
from evoclaims.networks.base import Bound, Network


@pytree
class Champion:
    """The best individual seen, judged on the current level.

    Attributes:
        parameters: its flat vector.
        episode: its last evaluation.
    """

    parameters: Float[Array, " parameters"]
    episode: Episode


def policy_of(network: Network, task: Task, parameters: Float[Array, " parameters"]) -> PolicyFn:
    """Bind parameters to a network of the task's sizes."""
    return Bound(network, parameters, task.action_size)


def evaluate(
    network: Network, task: Task, key: PRNGKeyArray, level: Int[Array, ""], population: Float[Array, "n parameters"]
) -> Episode:
    """Run one training episode per individual; the leaves of the result have shape [n]."""
    keys = jax.random.split(key, population.shape[0])
    return jax.vmap(lambda p, k: task.episode(policy_of(network, task, p), k, level).score)(population, keys)


def no_episode() -> Episode:
    """Return an episode that is worse than any other."""
    return Episode(fitness=jnp.full((), -jnp.inf, jnp.float32), success=jnp.zeros((), jnp.float32))


def first_champion(parameters: Float[Array, " parameters"]) -> Champion:
    """Return a champion with these parameters, shape [parameters], that any evaluated individual beats."""
    return Champion(parameters=parameters, episode=no_episode())


def evaluate_with_champion(
    network: Network,
    task: Task,
    key: PRNGKeyArray,
    level: Int[Array, ""],
    population: Float[Array, "n parameters"],
    champion: Champion,
) -> tuple[Episode, Champion, Bool[Array, ""]]:
    """Evaluate a population and its champion together, and return the best as the new champion.

    The old champion is evaluated again, because the level may have changed. A tie goes to the newcomer.

    Args:
        network: the network that all of them parametrize.
        task: the task.
        key: from which all episodes draw.
        level: of the task, counted from 0, shape [].
        population: one row of parameters for each individual, shape [n, parameters].
        champion: the best so far.

    Returns:
        The population's episodes (leaves [n]), the new champion, and whether all fitnesses and parameters are finite.
    """
    everyone = jnp.concatenate([population, champion.parameters[None]])
    episodes = evaluate(network, task, key, level, everyone)
    winner = jnp.argmax(episodes.fitness)
    best = Champion(parameters=everyone[winner], episode=jax.tree.map(lambda x: x[winner], episodes))
    healthy = jnp.all(jnp.isfinite(episodes.fitness)) & jnp.all(jnp.isfinite(everyone))
    kept = select(healthy, best, champion)
    return jax.tree.map(lambda x: x[:-1], episodes), kept, healthy


def champion_policy(network: Network, task: Task, champion: Champion) -> Policy:
    """Return the champion as a policy."""
    return Policy(
        parameters=champion.parameters,
        function=lambda parameters, observation: network.apply(parameters, observation, task.action_size),
    )
