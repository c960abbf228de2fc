"""NEAT in two niches of which one is fitter: who has offspring, what children inherit, and how long the other lives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.keys import stream
from evoclaims.envs.base import Episode, Task
from evoclaims.methods.base import Progress
from evoclaims.methods.mechanisms.observed import Observed, Question
from evoclaims.methods.neat.evolution import Evolution, Neat
from evoclaims.methods.neat.population import Population
from evoclaims.methods.neat.settings import Settings, Species
from evoclaims.networks.genome import Genome


@dataclass(frozen=True)
class TwoNiches(Question):
    """A positive answer earns 10 and itself, so that one can always do better; any other answer earns 0."""

    name: ClassVar[str] = "two_niches"
    packages: ClassVar[tuple[str, ...]] = Neat.packages
    observation_size: ClassVar[int] = 4

    action_size: int = 2

    def scored(self, answer: Float[Array, " action"]) -> Episode:
        """Return what the first number earns."""
        return Episode(fitness=jnp.where(answer[0] > 0, 10.0 + answer[0], 0.0), success=jnp.zeros(()))


@dataclass(frozen=True)
class NeatMechanisms(Observed):
    """NEAT whose children are traced to their parents by the numbers that they inherit.

    The first population has two niches: all numbers of every other genome are around `apart`, of the others around
    minus that. Before each step every number is changed a little, so that a child that has a number has it from one
    genome alone.

    Metrics:

    * "selection": which share of its species a parent is fitter than, averaged over parents.
    * "crossed": the share of children with numbers of two parents.
    * "structure_of_fitter", "structure_of_other": connections of children that only the fitter parent has, and that
      only the other one has.
    * "genes_of_fitter", "genes_of_other": numbers of children by the parent that they are from.
    * "elite": 1 if the fittest genome lives on unchanged, else 0.
    * "niche": the share of the next population in the niche that earns nothing.

    All but the last are about the niche that earns something.
    """

    of: Neat = Neat(
        Settings(
            population=64,
            nodes=12,
            connections=28,
            output="identity",
            species=Species(most=4, threshold=3.5, stagnation=5, exempt=1, survival=0.25),
        )
    )
    apart: float = 3.0
    spread: float = 0.3
    mark: float = 0.05

    def init(self, key: PRNGKeyArray, task: Task) -> Evolution:
        """Draw the first population, and divide it."""
        state: Evolution = self.of.init(key, task)
        population = state.population
        place = jnp.arange(self.of.settings.population, dtype=jnp.int32) % 2
        around = jnp.where(place == 0, self.apart, -self.apart)[:, None]
        genomes = _changed(population.genomes, lambda numbers, _: around + self.spread * numbers)
        species = population.species
        centres = jax.tree.map(lambda leaf, all_: leaf.at[:2].set(all_[:2]), species.centres, genomes)
        sizes = jnp.zeros_like(species.size).at[:2].set(jnp.bincount(place, length=2).astype(jnp.int32))
        species = replace(species, centres=centres, count=jnp.full((), 2, jnp.int32), size=sizes, member_of=place)
        return replace(state, population=replace(population, genomes=genomes, species=species))

    def step(self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Evolution) -> tuple[Any, Progress]:
        """Mark all numbers, and take a step."""
        marked = _changed(
            state.population.genomes,
            lambda numbers, part: numbers + self.mark * jax.random.normal(stream(key, part), numbers.shape),
        )
        return super().step(key, task, level, replace(state, population=replace(state.population, genomes=marked)))

    def seen(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], before: Evolution, after: Evolution
    ) -> Mapping[str, Float[Array, ""]]:
        """Trace the children to their parents."""
        parents, children = before.population.genomes, after.population.genomes
        encoding = self.of.encoding(task)
        fitness = jax.vmap(
            lambda genome: task.episode(partial(encoding.apply, encoding.express(genome)), key, level).fitness
        )(parents)
        shared = _shared(children, parents)  # children × parents
        one, two = jax.lax.top_k(shared, 2)[1].T
        has_two = jnp.take_along_axis(shared, two[:, None], 1)[:, 0] > 0
        earning = (self._in_niche(children) == 1) & (fitness[one] > 0) & (fitness[two] > 0)
        pair = earning & has_two & (fitness[one] != fitness[two])
        fitter, other = (jnp.where((fitness[one] > fitness[two]) == first, one, two) for first in (True, False))
        ahead = _rank(before.population, fitness)
        ranks = jnp.where(has_two, (ahead[one] + ahead[two]) / 2, ahead[one])
        of_fitter, of_other = _of_one_alone(children, parents, fitter, other)
        sizes = parents.node_count + parents.connection_count
        champion = jnp.argmax(fitness)
        unchanged = (shared[:, champion] == sizes[champion]) & (
            children.node_count + children.connection_count == sizes[champion]
        )

        def total(values: Array, counted: Bool[Array, " population"]) -> Float[Array, ""]:
            return jnp.sum(jnp.where(counted, values, 0).astype(jnp.float32))

        everyone = jnp.arange(sizes.shape[0])
        return {
            "selection": total(ranks, earning) / jnp.maximum(jnp.sum(earning), 1),
            "crossed": jnp.sum(pair) / jnp.maximum(jnp.sum(earning), 1),
            "structure_of_fitter": total(of_fitter, pair),
            "structure_of_other": total(of_other, pair),
            "genes_of_fitter": total(shared[everyone, fitter], pair),
            "genes_of_other": total(shared[everyone, other], pair),
            "elite": jnp.any(unchanged).astype(jnp.float32),
            "niche": jnp.mean((self._in_niche(children) == -1).astype(jnp.float32)),
        }

    def _in_niche(self, genomes: Genome) -> Int[Array, " population"]:
        """Return the sign of most numbers of each genome."""
        has_node, has_connection = _present(genomes)
        weights = jnp.where(has_connection, genomes.connections.weight, 0.0)
        biases = jnp.where(has_node, genomes.nodes.bias, 0.0)
        return jnp.sign(jnp.sum(weights, axis=1) + jnp.sum(biases, axis=1)).astype(jnp.int32)


def _changed(genomes: Genome, change: Any) -> Genome:
    """Return genomes with all their biases and weights changed."""
    nodes, genes = genomes.nodes, genomes.connections
    has_node, has_connection = _present(genomes)
    return replace(
        genomes,
        nodes=replace(nodes, bias=jnp.where(has_node, change(nodes.bias, "bias"), nodes.bias)),
        connections=replace(genes, weight=jnp.where(has_connection, change(genes.weight, "weight"), genes.weight)),
    )


def _present(genomes: Genome) -> tuple[Bool[Array, "population nodes"], Bool[Array, "population connections"]]:
    """Return which places of a population hold genes."""
    present: tuple[Array, Array] = jax.vmap(lambda genome: (genome.has_node, genome.has_connection))(genomes)
    return present


def _shared(children: Genome, parents: Genome) -> Int[Array, "children parents"]:
    """Count the numbers of each child that each parent has, too."""

    def equal(child: Array, parent: Array) -> Array:
        """NaN stands for no gene, and equals nothing."""
        return jnp.sum(child[:, None] == parent[None], dtype=jnp.int32)

    count = jax.vmap(jax.vmap(equal, (None, 0)), (0, None))

    def numbers(genomes: Genome) -> tuple[Array, Array]:
        has_node, has_connection = _present(genomes)
        return (
            jnp.where(has_node, genomes.nodes.bias, jnp.nan),
            jnp.where(has_connection, genomes.connections.weight, jnp.nan),
        )

    (biases, weights), (parent_biases, parent_weights) = numbers(children), numbers(parents)
    counts: Array = count(biases, parent_biases) + count(weights, parent_weights)
    return counts


def _rank(population: Population, fitness: Float[Array, " population"]) -> Float[Array, " population"]:
    """Return which share of the others of its species each genome is fitter than."""
    together = population.species.member_of[:, None] == population.species.member_of[None]
    behind = jnp.sum(together & (fitness[None] < fitness[:, None]), axis=1)
    return behind / jnp.maximum(jnp.sum(together, axis=1) - 1, 1)


def _of_one_alone(
    children: Genome, parents: Genome, fitter: Int[Array, " population"], other: Int[Array, " population"]
) -> tuple[Int[Array, " population"], Int[Array, " population"]]:
    """Count the connections of each child that only its fitter parent has, and those that only the other one has."""

    def links(genome: Genome) -> Array:
        keys, genes = genome.nodes.key, genome.connections
        pairs = jnp.stack([keys[genes.source], keys[genes.target]], axis=1)
        return jnp.where(genome.has_connection[:, None], pairs, -1)

    own, others = jax.vmap(links)(children), jax.vmap(links)(parents)

    def among(mine: Array, theirs: Array) -> Array:
        return jnp.any(jnp.all(mine[:, None] == theirs[None], axis=-1), axis=1) & (mine[:, 0] >= 0)

    in_fitter, in_other = (jax.vmap(among)(own, others[parent]) for parent in (fitter, other))
    return (
        jnp.sum(in_fitter & ~in_other, axis=1, dtype=jnp.int32),
        jnp.sum(in_other & ~in_fitter, axis=1, dtype=jnp.int32),
    )
