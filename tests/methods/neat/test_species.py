"""Grouping into species against a sequential account of it."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import reference
from genomes import at, made, read, read_all, same, stacked
from history import History
from hypothesis import given, settings
from hypothesis import strategies as st
from reference import Node

from evoclaims.methods.neat.settings import Species
from evoclaims.methods.neat.species import SpeciesState, speciate
from evoclaims.networks.genome import Genome

POINTS, MOST = 12, 4
SETTINGS = Species(most=MOST)


def _speciating(on_gpu: bool, kernels: bool = True) -> Any:
    """Return the compiled function, as processors or as GPUs group a population."""

    def run(species: SpeciesState, population: Genome, generation: Any) -> SpeciesState:
        with pytest.MonkeyPatch.context() as patch:
            if on_gpu:
                patch.setattr("evoclaims.methods.neat.species.by_platform", lambda _, on_gpu: on_gpu)
                patch.setattr("evoclaims.methods.neat.species.gpus_run_kernels", lambda: kernels)
            return speciate(SETTINGS, species, population, generation)

    return jax.jit(run)


WAYS = {
    "processors": _speciating(on_gpu=False),
    "GPUs": _speciating(on_gpu=True),
    "GPUs without kernels": _speciating(on_gpu=True, kernels=False),
}
each_way = pytest.mark.parametrize("way", WAYS)


def test_sizes_add_up_and_every_genome_belongs_to_a_species_that_is_alive(history: History) -> None:
    species = history.populations.species
    alive = np.arange(history.settings.species.most) < species.count[:, None]
    assert (species.count >= 1).all()
    assert (species.size.sum(axis=1) == history.settings.population).all()
    assert ((species.size > 0) == alive).all()
    for member_of, size in zip(species.member_of, species.size, strict=True):
        np.testing.assert_array_equal(np.bincount(member_of, minlength=len(size)), size)
    assert len(set(species.count.tolist())) > 4


def test_a_population_is_divided_as_the_reference_divides_it(history: History) -> None:
    chosen, full = history.settings.species, 0
    for generation in range(0, len(history.fitness), 6):
        now, following = history.at(generation), history.at(generation + 1)
        old = [read(at(now.species.centres, place)) for place in history.survivors(generation)]
        genomes = read_all(following.genomes)
        member_of, centres = reference.speciate(old, genomes, chosen.most, chosen.threshold)
        assert following.species.member_of.tolist() == member_of
        assert int(following.species.count) == len(centres)
        for place, centre in enumerate(centres):
            assert same(at(following.species.centres, place), at(following.genomes, centre))
        full += len(centres) == chosen.most and any(
            reference.distance(genomes[centres[-1]], genomes[i]) >= chosen.threshold
            for i in range(len(genomes))
            if member_of[i] == chosen.most - 1
        )
    assert full, "no generation had leftovers for the last species"


def test_survivors_keep_their_records_and_new_species_have_none(history: History) -> None:
    died = 0
    for generation in range(len(history.fitness)):
        before, species = history.at(generation).species, history.at(generation + 1).species
        kept = history.survivors(generation)
        died += int(before.count) - len(kept)
        count = int(species.count)
        assert count >= len(kept) >= min(int(before.count), history.settings.species.exempt)
        assert species.best[: len(kept)].tolist() == [record.best for record in kept.values()]
        assert species.improved_at[: len(kept)].tolist() == [record.improved_at for record in kept.values()]
        assert np.isneginf(species.best[len(kept) : count]).all()
        assert (species.improved_at[len(kept) : count] == generation + 1).all()
    assert died > 20


def _point(x: float) -> Genome:
    """Return a genome at distance 0.2 |x - y| from the one at y."""
    return made([0, 1], {}, {1: Node(bias=x)}, capacity=(2, 1))


def _line(centres: list[float], points: list[float]) -> tuple[Genome, SpeciesState]:
    """Return a population of points, and what was known of its species before."""
    population = stacked([_point(x) for x in points])
    return population, SpeciesState(
        centres=stacked([_point(x) for x in [*centres, *[0.0] * (MOST - len(centres))]]),
        count=jnp.asarray(len(centres), jnp.int32),
        best=jnp.arange(float(MOST)),
        improved_at=jnp.arange(MOST, dtype=jnp.int32),
        size=jnp.zeros(MOST, jnp.int32),
        member_of=jnp.zeros(len(points), jnp.int32),
    )


def _divided(way: str, centres: list[float], points: list[float]) -> SpeciesState:
    population, species = _line(centres, points)
    divided: SpeciesState = WAYS[way](species, population, jnp.asarray(7, jnp.int32))
    return divided


def _places(species: SpeciesState) -> list[float]:
    """Return where on the line the centres of the species alive are."""
    return np.asarray(species.centres.nodes.bias)[: int(species.count), 1].tolist()


places = st.integers(-40, 40).map(float)


@each_way
@settings(max_examples=80, deadline=None)
@given(st.lists(places, max_size=MOST, min_size=1), st.lists(places, min_size=POINTS, max_size=POINTS))
def test_points_on_a_line_are_divided_as_the_reference_divides_them(
    way: str, centres: list[float], points: list[float]
) -> None:
    species = _divided(way, centres, points)
    genes = [read(_point(x)) for x in points]
    member_of, chosen = reference.speciate([read(_point(x)) for x in centres], genes, MOST, 2.0)
    assert np.asarray(species.member_of).tolist() == member_of
    assert _places(species) == [points[i] for i in chosen]
    assert np.asarray(species.size).tolist() == np.bincount(member_of, minlength=MOST).tolist()
    new = MOST - len(centres)
    assert np.asarray(species.best).tolist() == [float(i) for i in range(len(centres))] + [-np.inf] * new
    assert np.asarray(species.improved_at).tolist() == [*range(len(centres)), *[7] * new]


@each_way
def test_populations_side_by_side_are_divided_as_one_by_one(way: str) -> None:
    """The number of species differs, so that loops end at different times."""
    lines: list[Any] = [([0.0], [0.0] * POINTS), ([0.0, 20.0], [5.0 * i for i in range(POINTS)])]
    lines.append(([1.0, 2.0, 3.0], [1.0 + i for i in range(POINTS)]))
    populations, states = zip(*(_line(*line) for line in lines), strict=True)
    together = jax.jit(jax.vmap(WAYS[way], in_axes=(0, 0, None)))(
        stacked(states), stacked(populations), jnp.asarray(7, jnp.int32)
    )
    for i, line in enumerate(lines):
        assert same(at(together, i), _divided(way, *line))
