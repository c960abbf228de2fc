"""A population of genomes, and how the next one is made."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.keys import streams
from evoclaims.core.pytree import pytree, select
from evoclaims.kernels import take_rows
from evoclaims.methods.neat.capacity import in_capacity
from evoclaims.methods.neat.homology import crossover
from evoclaims.methods.neat.mutation import draw, mutate_structure, mutate_values
from evoclaims.methods.neat.settings import Settings, Species
from evoclaims.methods.neat.species import SpeciesState, one_species, speciate
from evoclaims.networks.genome import EMPTY, Connections, Genome, Nodes, resized


@pytree
class Parents:
    """The parents of the next population, as indices into the current one.

    Attributes:
        fitter, other: the two parents of each child, which inherits the structure of `fitter`.
        elite: whether the child is `fitter` itself, unchanged.
    """

    fitter: Int[Array, " population"]
    other: Int[Array, " population"]
    elite: Bool[Array, " population"]


def survive(
    settings: Species, species: SpeciesState, fitness: Float[Array, " population"], generation: Int[Array, ""]
) -> SpeciesState:
    """Let stagnant species die, and sort the others by their best member, the best first.

    A species is stagnant when no member beats its record and the record is older than `settings.stagnation`
    generations; the `settings.exempt` best never die. Of equal species the later comes first.
    """
    places = jnp.arange(settings.most, dtype=jnp.int32)
    alive = places < species.count
    members = species.member_of[None, :] == places[:, None]
    top = jnp.max(jnp.where(members, fitness[None, :], -jnp.inf), axis=1)
    improved = top > species.best
    stagnant = ~improved & (generation - species.improved_at > settings.stagnation)
    rank = jnp.argsort(jnp.argsort(jnp.where(alive, -top, jnp.inf), stable=True), stable=True)
    alive &= ~stagnant | (rank < settings.exempt)
    order = jnp.lexsort((-places, -top, ~alive))
    new_place = jnp.zeros_like(places).at[order].set(places)
    return SpeciesState(
        centres=take_rows(species.centres, order),
        count=jnp.sum(alive, dtype=jnp.int32),
        best=jnp.where(improved, top, species.best)[order],
        improved_at=jnp.where(improved, generation, species.improved_at)[order],
        size=jnp.where(alive, species.size, 0)[order],
        member_of=new_place[species.member_of],
    )


def offspring(settings: Species, species: SpeciesState, population: int) -> Int[Array, " species"]:
    """Return how many members each species gets; `species` is sorted, the best first.

    Of V species, the one of rank i has the target floor(P (V - i) / (V (V + 1) / 2)), and moves part of the way to it
    from its size; the rest from rounding goes to the first.
    """
    places = jnp.arange(settings.most, dtype=jnp.int32)
    alive = places < species.count
    aim = 2 * population * (species.count - places) // (species.count * (species.count + 1))
    step = (aim - species.size).astype(jnp.float32) * settings.change
    count = jnp.trunc(species.size.astype(jnp.float32) + step).astype(jnp.int32)
    count = jnp.where(alive, jnp.maximum(count, 1), 0)
    return count.at[0].add(population - jnp.sum(count))


def choose_parents(
    key: PRNGKeyArray, settings: Species, species: SpeciesState, fitness: Float[Array, " population"]
) -> Parents:
    """Draw two parents for every child from the best of its species; a species' first children are its elites.

    Children of the first species come first. A species has at most as many elites as members.
    """
    population = fitness.shape[0]
    count = offspring(settings, species, population)
    children = jnp.arange(population, dtype=jnp.int32)
    ends = jnp.cumsum(count, dtype=jnp.int32)
    family = jnp.sum(ends[None, :] <= children[:, None], axis=1, dtype=jnp.int32)
    rank = children - (ends - count)[family]
    # Sort members by species, then by fitness (best first), then newest first.
    order = jnp.lexsort((-children, -fitness, species.member_of)).astype(jnp.int32)
    first = jnp.cumsum(species.size, dtype=jnp.int32) - species.size
    pool = jnp.maximum(jnp.floor(settings.survival * species.size.astype(jnp.float32)).astype(jnp.int32), 1)
    one_key, two_key = streams(key, "one", "two")
    one = order[first[family] + jax.random.randint(one_key, children.shape, 0, pool[family], jnp.int32)]
    two = order[first[family] + jax.random.randint(two_key, children.shape, 0, pool[family], jnp.int32)]
    elite = rank < jnp.minimum(settings.elites, species.size[family])
    self = order[first[family] + jnp.minimum(rank, species.size[family] - 1)]
    ahead = fitness[one] >= fitness[two]
    return Parents(
        fitter=jnp.where(elite, self, jnp.where(ahead, one, two)),
        other=jnp.where(elite, self, jnp.where(ahead, two, one)),
        elite=elite,
    )


@pytree
class Population:
    """The genomes of one generation.

    Attributes:
        genomes: leaves [population, …].
        species: how they are grouped.
        generation: number of populations before this one.
        next_key: the historical marking of the next new node; a 32-bit integer lasts for 2³¹ / population generations.
    """

    genomes: Genome
    species: SpeciesState
    generation: Int[Array, ""]
    next_key: Int[Array, ""]


def first_population(key: PRNGKeyArray, settings: Settings, inputs: int, outputs: int) -> Population:
    """Draw genomes in which every input feeds every output, and put them into one species.

    Raises:
        UserError: when the smallest network does not fit.
    """
    settings.check_fits(inputs, outputs)
    keys = jax.random.split(key, settings.population)
    genomes = jax.vmap(lambda k: _first_genome(k, settings, inputs, outputs))(keys)
    return Population(
        genomes=genomes,
        species=one_species(settings.species, genomes),
        generation=jnp.zeros((), jnp.int32),
        next_key=jnp.full((), inputs + outputs, jnp.int32),
    )


def next_population(
    key: PRNGKeyArray,
    settings: Settings,
    sizes: Sequence[tuple[int, int]],
    population: Population,
    fitness: Float[Array, " population"],
    inputs: int,
    outputs: int,
    choose: Callable[..., Parents] = choose_parents,
) -> Population:
    """Replace all genomes except elites by offspring of the best of each species, whose parents `choose` draws.

    It works in arrays of one of the capacities `sizes`, which makes no difference. A fitness of NaN counts as -inf.
    """
    parents_key, breeding_key = streams(key, "parents", "breeding")
    fitness = jnp.where(jnp.isnan(fitness), -jnp.inf, fitness)
    species = survive(settings.species, population.species, fitness, population.generation + 1)
    parents = choose(parents_key, settings.species, species, fitness)
    survivors = replace(population, species=species)
    breed = partial(_breed, settings, inputs, outputs)
    following: Population = in_capacity(
        sizes, (population.genomes, species.centres), breed, breeding_key, survivors, parents
    )
    return following


def forget_records(population: Population) -> Population:
    """Let every species count as improved in the next generation: fitness is not comparable across levels."""
    best = jnp.full_like(population.species.best, -jnp.inf)
    return replace(population, species=replace(population.species, best=best))


def _breed(
    settings: Settings,
    inputs: int,
    outputs: int,
    nodes: int,
    connections: int,
    key: PRNGKeyArray,
    population: Population,
    parents: Parents,
) -> Population:
    """Replace the genomes by the parents' children, in arrays of the given capacity."""
    crossover_key, mutation_key = streams(key, "crossover", "mutation")
    small = in_arrays(population, nodes, connections)
    children = _crossed(crossover_key, small.genomes, parents)

    def mutated(key: PRNGKeyArray, genome: Genome, new_key: Array) -> Genome:
        structure_key, values_key = streams(key, "structure", "values")
        changed = mutate_structure(structure_key, settings.mutation, genome, new_key, inputs, outputs)
        return mutate_values(values_key, settings.mutation, len(settings.activations), changed)

    size = parents.elite.shape[0]
    new_keys = population.next_key + jnp.arange(size, dtype=jnp.int32)
    mutants = jax.vmap(mutated)(jax.random.split(mutation_key, size), children, new_keys)
    bred = jax.vmap(select)(parents.elite, children, mutants)
    generation = population.generation + 1
    following = Population(
        genomes=bred,
        species=speciate(settings.species, small.species, bred, generation),
        generation=generation,
        next_key=population.next_key + size,
    )
    given = population.genomes
    return in_arrays(following, given.nodes.key.shape[-1], given.connections.source.shape[-1])


def in_arrays(population: Population, nodes: int, connections: int) -> Population:
    """Cut or pad the arrays to these capacities; what is cut off must be empty."""
    return replace(
        population,
        genomes=resized(population.genomes, nodes, connections),
        species=replace(population.species, centres=resized(population.species.centres, nodes, connections)),
    )


def _crossed(key: PRNGKeyArray, genomes: Genome, parents: Parents) -> Genome:
    """Return the children before mutation."""
    keys = jax.random.split(key, parents.fitter.shape[0])
    fitter = take_rows(genomes, parents.fitter)
    # With the paper's survival threshold most species have a single parent: no crossover is needed.
    children: Genome = jax.lax.cond(
        jnp.any(parents.fitter != parents.other),
        lambda: jax.vmap(crossover)(keys, fitter, take_rows(genomes, parents.other)),
        lambda: fitter,
    )
    return children


def _first_genome(key: PRNGKeyArray, settings: Settings, inputs: int, outputs: int) -> Genome:
    """Draw one genome without hidden nodes."""
    bias_key, response_key, activation_key, weight_key = streams(key, "bias", "response", "activation", "weight")
    nodes, connections = inputs + outputs, inputs * outputs
    slots, places = jnp.arange(settings.nodes), jnp.arange(settings.connections)
    has_node, has_connection = slots < nodes, places < connections
    activation = jax.random.randint(activation_key, slots.shape, 0, len(settings.activations), jnp.int32)
    mutation = settings.mutation
    return Genome(
        nodes=Nodes(
            key=jnp.where(has_node, slots, EMPTY),
            bias=jnp.where(has_node, draw(bias_key, mutation.bias, settings.nodes), 0),
            response=jnp.where(has_node, draw(response_key, mutation.response, settings.nodes), 0),
            activation=jnp.where(has_node, activation, 0),
        ),
        connections=Connections(
            source=jnp.where(has_connection, places // outputs, 0),
            target=jnp.where(has_connection, inputs + places % outputs, 0),
            weight=jnp.where(has_connection, draw(weight_key, mutation.weight, settings.connections), 0),
        ),
        node_count=jnp.full((), nodes, jnp.int32),
        connection_count=jnp.full((), connections, jnp.int32),
    )
