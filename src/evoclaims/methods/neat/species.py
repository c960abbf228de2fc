"""Species: groups of similar genomes that compete with each other (Stanley and Miikkulainen 2002, §3.3).

TensorNEAT's variant: a species has a centre; a genome joins the nearest centre within the threshold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from evoclaims.core.pytree import pytree
from evoclaims.kernels import by_platform, gpus_run_kernels, take_rows
from evoclaims.methods.neat.homology import arranged, distance, distances
from evoclaims.methods.neat.settings import Species
from evoclaims.networks.genome import Genome

NONE = -1


@pytree
class SpeciesState:
    """The species alive, packed into the first places.

    Attributes:
        centres: the genome that represents each species; leaves [species, …].
        count: how many are alive.
        best: the best fitness of each species so far; -inf for a new one.
        improved_at: the generation that reached `best`.
        size: members in the current population; 0 for unused places.
        member_of: the species of each genome of the population.
    """

    centres: Genome
    count: Int[Array, ""]
    best: Float[Array, " species"]
    improved_at: Int[Array, " species"]
    size: Int[Array, " species"]
    member_of: Int[Array, " population"]


def one_species(settings: Species, population: Genome) -> SpeciesState:
    """Put a whole first population into one species around its first genome."""
    size = population.node_count.shape[0]
    return SpeciesState(
        centres=jax.tree.map(lambda leaf: jnp.broadcast_to(leaf[0], (settings.most, *leaf.shape[1:])), population),
        count=jnp.ones((), jnp.int32),
        best=jnp.full((settings.most,), -jnp.inf, jnp.float32),
        improved_at=jnp.zeros((settings.most,), jnp.int32),
        size=jnp.zeros((settings.most,), jnp.int32).at[0].set(size),
        member_of=jnp.zeros((size,), jnp.int32),
    )


@pytree
class _Grouping:
    """A partly grouped population.

    Attributes:
        centre_of: the genome that is each species' centre.
        member_of: each genome's species so far, or `NONE`.
        nearest: each genome's distance to that species' centre.
    """

    count: Int[Array, ""]
    centre_of: Int[Array, " species"]
    member_of: Int[Array, " population"]
    nearest: Float[Array, " population"]


def speciate(settings: Species, species: SpeciesState, population: Genome, generation: Int[Array, ""]) -> SpeciesState:
    """Divide a population among the species that are alive, and found new ones where there is room.

    First the genome nearest to each old centre becomes the new centre. Then every genome joins the nearest centre
    within the threshold. Then, one by one, the first genome without a species founds one, while there is room. The
    remaining genomes join the last species.
    """
    group = by_platform(partial(_grouped_in_turn, settings), partial(_grouped_on_gpus, settings))
    grouping: _Grouping = group(species.centres, species.count, population)
    member_of = jnp.where(grouping.member_of == NONE, settings.most - 1, grouping.member_of)
    places = jnp.arange(settings.most)
    alive, new = places < grouping.count, places >= species.count
    return SpeciesState(
        centres=take_rows(population, grouping.centre_of),
        count=grouping.count,
        best=jnp.where(new, -jnp.inf, species.best),
        improved_at=jnp.where(new, generation, species.improved_at),
        size=jnp.where(alive, jnp.sum(member_of[None, :] == places[:, None], axis=1, dtype=jnp.int32), 0),
        member_of=member_of,
    )


def _grouped_in_turn(settings: Species, centres: Genome, count: Int[Array, ""], population: Genome) -> _Grouping:
    """Group a population, one species after the other."""

    def to_all(centre: Genome) -> Array:
        result: Array = jax.vmap(lambda genome: distance(settings, genome, centre))(population)
        return result

    def recentre(place: Array, grouping: _Grouping) -> _Grouping:
        # Only genomes that are no centre yet, so that two species never share one.
        distances = to_all(take_rows(centres, place))
        chosen = jnp.argmin(jnp.where(grouping.member_of == NONE, distances, jnp.inf)).astype(jnp.int32)
        return _join(grouping, place, chosen)

    def gather(place: Array, grouping: _Grouping) -> _Grouping:
        distances = to_all(take_rows(population, grouping.centre_of[place]))
        return _attract(settings, grouping, place, distances)

    size = population.node_count.shape
    grouping = _Grouping(
        count=count,
        centre_of=jnp.zeros((settings.most,), jnp.int32),
        member_of=jnp.full(size, NONE, jnp.int32),
        nearest=jnp.full(size, jnp.inf),
    )
    # All centres are chosen before any genome joins: one that has joined could no longer become a centre.
    grouping = jax.lax.fori_loop(0, count, recentre, grouping)
    grouping = jax.lax.fori_loop(0, count, gather, grouping)
    return _with_new_species(settings, population, grouping, to_all)


def _grouped_on_gpus(settings: Species, centres: Genome, count: Int[Array, ""], population: Genome) -> _Grouping:
    group = _grouped_at_once if gpus_run_kernels() else _grouped_in_turn
    return group(settings, centres, count, population)


def _grouped_at_once(settings: Species, centres: Genome, count: Int[Array, ""], population: Genome) -> _Grouping:
    """Return the same up to rounding, for GPUs, which wait for every number of rounds that they have computed."""

    def to_founder(founder: Genome) -> Array:
        alone = jax.tree.map(lambda leaf: leaf[None], founder)
        return distances(settings, as_compared, alone, jnp.ones((), jnp.int32))[0]

    def recentred(chosen: Array) -> Array:
        """Choose for each old centre the nearest genome that is not `chosen` for an earlier one."""
        takers = jnp.where(chosen[:, None] == everyone[None, :], places[:, None], settings.most)
        free = jnp.min(takers, axis=0)[None, :] >= places[:, None]
        nearest = jnp.argmin(jnp.where(free, to_old, jnp.inf), axis=1).astype(jnp.int32)
        return jnp.where(places < count, nearest, NONE)

    everyone, places = jnp.arange(population.node_count.shape[0]), jnp.arange(settings.most, dtype=jnp.int32)
    as_compared = arranged(population)  # once, and not for each founder
    to_old = distances(settings, as_compared, centres, count)
    # One after the other would be as many rounds as species. Two seldom want the same genome.
    wanted = recentred(jnp.full((settings.most,), NONE, jnp.int32))
    chosen = jax.lax.while_loop(lambda chosen: jnp.any(recentred(chosen) != chosen), recentred, wanted)
    centre_of = jnp.where(chosen == NONE, 0, chosen)
    to_new = distances(settings, as_compared, take_rows(population, centre_of), count)
    is_centre = chosen[:, None] == everyone[None, :]
    # A centre stays in its own species, even where another one's is its equal; one of several species in the last.
    own = -1.0 - places[:, None].astype(jnp.float32)
    within = jnp.where(is_centre, own, jnp.where(to_new < settings.threshold, to_new, jnp.inf))
    nearest = jnp.min(within, axis=0)
    member_of = jnp.where(nearest < jnp.inf, jnp.argmin(within, axis=0).astype(jnp.int32), NONE)
    grouping = _Grouping(count, centre_of, member_of, jnp.maximum(nearest, 0.0))
    return _with_new_species(settings, population, grouping, to_founder)


def _with_new_species(
    settings: Species, population: Genome, grouping: _Grouping, to_all: Callable[[Genome], Array]
) -> _Grouping:
    """Found species one by one, while there is room; `to_all` returns every genome's distance to a founder."""

    def found(grouping: _Grouping) -> _Grouping:
        # The founder also draws nearer genomes from older species, as if its species had been there all along.
        founder = jnp.argmax(grouping.member_of == NONE).astype(jnp.int32)
        founded = _join(grouping, grouping.count, founder)
        distances = to_all(take_rows(population, founder))
        return replace(_attract(settings, founded, grouping.count, distances), count=grouping.count + 1)

    def unfinished(grouping: _Grouping) -> Bool[Array, ""]:
        return jnp.any(grouping.member_of == NONE) & (grouping.count < settings.most)

    made: _Grouping = jax.lax.while_loop(unfinished, found, grouping)
    return made


def _join(grouping: _Grouping, place: Int[Array, ""], chosen: Int[Array, ""]) -> _Grouping:
    """Make the genome `chosen` the centre of the species at `place`."""
    is_centre = jnp.arange(grouping.member_of.shape[0]) == chosen
    return replace(
        grouping,
        centre_of=jnp.where(jnp.arange(grouping.centre_of.shape[0]) == place, chosen, grouping.centre_of),
        member_of=jnp.where(is_centre, place, grouping.member_of),
        nearest=jnp.where(is_centre, 0.0, grouping.nearest),
    )


def _attract(
    settings: Species, grouping: _Grouping, place: Int[Array, ""], distances: Float[Array, " population"]
) -> _Grouping:
    """Add to the species at `place` all genomes within the threshold that are not in a nearer one."""
    free = grouping.member_of == NONE
    joins = (distances < settings.threshold) & (free | (distances < grouping.nearest))
    return replace(
        grouping,
        member_of=jnp.where(joins, place, grouping.member_of),
        nearest=jnp.where(joins, distances, grouping.nearest),
    )
