"""One long evolution under random fitness, which the tests of all its parts look at."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import reference
from reference import Record

from evoclaims.methods.neat.capacity import capacities
from evoclaims.methods.neat.population import Population, first_population, next_population
from evoclaims.methods.neat.settings import Attribute, Mutation, Settings, Species
from evoclaims.methods.neat.species import SpeciesState

INPUTS, OUTPUTS, GENERATIONS = 3, 2, 200
BOUNDED = Attribute(power=0.3, bound=2.0)
SETTINGS = Settings(
    population=96,
    nodes=20,
    connections=30,
    activations=("tanh", "sin", "gauss"),
    mutation=Mutation(
        node_add=0.5,
        node_delete=0.15,
        connection_add=0.9,
        connection_delete=0.15,
        bias=BOUNDED,
        response=replace(BOUNDED, mean=1.0, std=0.0),
        weight=BOUNDED,
    ),
    species=Species(most=9, threshold=1.2, stagnation=6, survival=0.3),
)
FIRST_KEY = 2**24 + 1
"""The first key that float32 cannot tell from its neighbour."""


@dataclass(frozen=True)
class History:
    """Every generation of an evolution, on the host.

    Attributes:
        populations: leaves [generations + 1, …].
        fitness: [generations, population]; few different values, NaN among them.
    """

    settings: Settings
    inputs: int
    outputs: int
    populations: Population
    fitness: Any

    def at(self, generation: int) -> Population:
        """Return one generation."""
        chosen: Population = jax.tree.map(lambda leaf: leaf[generation], self.populations)
        return chosen

    def survivors(self, generation: int) -> dict[int, Record]:
        """Return which species of a generation the reference lets survive, under their old places, in their order."""
        species, chosen = self.at(generation).species, self.settings.species
        fitness = np.nan_to_num(self.fitness[generation], nan=-np.inf).tolist()
        known = records(species, int(species.count))
        return reference.survive(known, fitness, generation + 1, chosen.stagnation, chosen.exempt)


def records(species: SpeciesState, count: int) -> dict[int, Record]:
    """Return the species alive as the reference knows them."""
    members: dict[int, list[int]] = {place: [] for place in range(count)}
    for genome, place in enumerate(np.asarray(species.member_of).tolist()):
        members[place].append(genome)
    return {
        place: Record(float(species.best[place]), int(species.improved_at[place]), tuple(members[place]))
        for place in range(count)
    }


def evolved() -> History:
    """Run an evolution that reaches the limits of its genomes, with keys above 2²⁴."""

    def generation(population: Population, key: jax.Array) -> tuple[Population, Any]:
        draw, breed = jax.random.split(key)
        drawn = jax.random.randint(draw, (SETTINGS.population,), 0, 8)
        fitness = jnp.where(drawn == 0, jnp.nan, drawn.astype(jnp.float32))
        sizes = capacities(SETTINGS, INPUTS, OUTPUTS)
        following = next_population(breed, SETTINGS, sizes, population, fitness, INPUTS, OUTPUTS)
        return following, (population, fitness)

    @jax.jit
    def evolution(key: jax.Array) -> Any:
        first, rest = jax.random.split(key)
        start = replace(first_population(first, SETTINGS, INPUTS, OUTPUTS), next_key=jnp.full((), FIRST_KEY, jnp.int32))
        last, (before, fitness) = jax.lax.scan(generation, start, jax.random.split(rest, GENERATIONS))
        populations = jax.tree.map(lambda leaf, end: jnp.concatenate([leaf, end[None]]), before, last)
        return populations, fitness

    populations, fitness = jax.device_get(evolution(jax.random.key(7)))
    return History(SETTINGS, INPUTS, OUTPUTS, populations, fitness)
