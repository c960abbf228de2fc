"""One generation: express, evaluate, reproduce; the same for every encoding."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar, Protocol

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray

from evoclaims.core.keys import streams
from evoclaims.core.pytree import pytree, select, static
from evoclaims.envs.base import Episode, Task
from evoclaims.kernels import take_rows
from evoclaims.methods.base import Policy, Progress
from evoclaims.methods.flat_champion import no_episode
from evoclaims.methods.neat.capacity import capacities, fitting, in_capacity
from evoclaims.methods.neat.population import (
    Parents,
    Population,
    choose_parents,
    first_population,
    forget_records,
    in_arrays,
    next_population,
)
from evoclaims.methods.neat.settings import PAPER, Settings
from evoclaims.networks.genome import Genome, resized
from evoclaims.networks.graph import GraphNetwork


class Encoding(Protocol):
    """How a genome encodes a policy; frozen and hashable."""

    def express(self, genome: Genome) -> Any:
        """Turn a genome into its phenotype: a tree of arrays."""

    def apply(self, phenotype: Any, observation: Float[Array, " observation"]) -> Float[Array, " action"]:
        """Act on one observation."""


@pytree
class Evolution:
    """The state of NEAT between two generations.

    Attributes:
        population: not yet evaluated.
        level: the level of the last evaluation.
        champion: the best genome of the last evaluation; leaves [nodes] and [connections].
        episode: the champion's episode.
        size: the capacities (nodes, connections) of the genomes' arrays, in which steps stay; None for the largest,
            where each step works in the smallest that suffice.
    """

    population: Population
    level: Int[Array, ""]
    champion: Genome
    episode: Episode
    size: tuple[int, int] | None = static(default=None)


class GenomeMethod(ABC):
    """A method that evolves genomes; a subclass, a frozen dataclass with `settings`, says what a genome describes."""

    settings: Settings

    @abstractmethod
    def network(self, task: Task) -> GraphNetwork:
        """Return the network that a genome describes."""

    def encoding(self, task: Task) -> Encoding:
        """Return how a genome encodes a policy of the task's size: by default, its network is the policy's."""
        return self.network(task)

    def init(self, key: PRNGKeyArray, task: Task) -> Evolution:
        """Draw the first population; a `UserError` says when a policy or the smallest network does not fit."""
        _ = self.encoding(task)
        network = self.network(task)
        population = first_population(key, self.settings, network.inputs, network.outputs)
        return Evolution(
            population=population,
            level=jnp.zeros((), jnp.int32),
            champion=jax.tree.map(lambda leaf: leaf[0], population.genomes),
            episode=no_episode(),
        )

    def step(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Evolution
    ) -> tuple[Evolution, Progress]:
        """Evaluate the population on `level` and replace it by the next."""
        network, settings, population = self.network(task), self.settings, state.population
        if settings.species.on_level_up == "reset":
            population = select(level == state.level, population, forget_records(population))
        episode_key, reproduction_key = streams(key, "episode", "reproduction")
        run = partial(_evaluate, self.encoding(task), task)
        sizes = [state.size] if state.size else self.sizes(task)
        episodes = in_capacity(sizes, (population.genomes,), run, episode_key, level, population.genomes)
        fitness = jnp.where(jnp.isnan(episodes.fitness), -jnp.inf, episodes.fitness)
        # The newest of equals, as everywhere in NEAT.
        best = settings.population - 1 - jnp.argmax(fitness[::-1])
        champion, episode = take_rows((population.genomes, episodes), best)
        following = next_population(
            reproduction_key, settings, sizes, population, fitness, network.inputs, network.outputs, self.parents
        )
        genomes = population.genomes
        metrics = {
            "nodes": jnp.mean(genomes.node_count.astype(jnp.float32)),
            "connections": jnp.mean(genomes.connection_count.astype(jnp.float32)),
            "champion_nodes": champion.node_count.astype(jnp.float32),
            "champion_connections": champion.connection_count.astype(jnp.float32),
            "species": population.species.count.astype(jnp.float32),
        }
        genes = champion.nodes.bias, champion.nodes.response, champion.connections.weight
        healthy = jnp.all(jnp.isfinite(jnp.concatenate([*genes, episode.fitness[None]])))
        progress = Progress(fitness=episode.fitness, success=episode.success, healthy=healthy, metrics=metrics)
        after = Evolution(population=following, level=level, champion=champion, episode=episode, size=state.size)
        return after, progress

    def sizes(self, task: Task) -> list[tuple[int, int]]:
        """Return the capacities (nodes, connections) that a generation may work in, the largest last."""
        network = self.network(task)
        return capacities(self.settings, network.inputs, network.outputs)

    def size_for(self, task: Task, state: Evolution) -> Int[Array, ""]:
        """Return the place of the smallest size that the next generation fits."""
        population = state.population
        return fitting(self.sizes(task), (population.genomes, population.species.centres, state.champion))

    def in_size(self, size: tuple[int, int] | None, state: Evolution) -> Evolution:
        """Return the state in arrays of a size in which its steps stay; None for the largest, where they choose."""
        most = size or (self.settings.nodes, self.settings.connections)
        champion = resized(state.champion, *most)
        return replace(state, population=in_arrays(state.population, *most), champion=champion, size=size)

    def parents(self, *chosen_from: Any) -> Parents:
        """Draw the parents of the next population; the arguments are those of `choose_parents`."""
        return choose_parents(*chosen_from)

    def best(self, task: Task, state: Evolution) -> Policy:
        """Return the best genome of the last population that was evaluated, on the level it was evaluated on."""
        encoding = self.encoding(task)
        return Policy(parameters=state.champion, function=lambda genome, x: encoding.apply(encoding.express(genome), x))

    def cost(self, task: Task) -> int:
        """Return the environment steps of one generation, at the longest episode."""
        return self.settings.population * task.horizon


def _evaluate(
    encoding: Encoding,
    task: Task,
    nodes: int,
    connections: int,
    key: PRNGKeyArray,
    level: Int[Array, ""],
    genomes: Genome,
) -> Episode:
    """Run an episode per genome, in arrays of the given capacity; leaves of the result are [population]."""

    def evaluate(key: PRNGKeyArray, genome: Genome) -> Episode:
        return task.episode(partial(encoding.apply, encoding.express(genome)), key, level).score

    small = resized(genomes, nodes, connections)
    return jax.vmap(evaluate)(jax.random.split(key, small.node_count.shape[0]), small)


@dataclass(frozen=True)
class Neat(GenomeMethod):
    """NEAT (Stanley and Miikkulainen 2002) whose genomes are the policies' networks.

    Attributes:
        settings: all hyperparameters; the defaults are the paper's.
    """

    name: ClassVar[str] = "neat"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ("llvmlite",)

    settings: Settings = PAPER

    def network(self, task: Task) -> GraphNetwork:
        """Return the policy's network."""
        return GraphNetwork(task.observation_size, task.action_size, self.settings.activations, self.settings.output)
