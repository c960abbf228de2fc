"""Which genomes have offspring, and how many (TensorNEAT; ties go to the newest genome)."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.keys import streams
from evoclaims.core.pytree import pytree
from evoclaims.kernels import take_rows
from evoclaims.methods.neat.settings import Species
from evoclaims.methods.neat.species import SpeciesState


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
