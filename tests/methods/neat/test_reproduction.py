"""Who survives, and who has how many offspring, against a sequential account of it."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import reference
from genomes import at, made, same, stacked
from history import History, records
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest

from evoclaims.methods.neat.population import choose_parents, offspring, survive
from evoclaims.methods.neat.settings import Species
from evoclaims.methods.neat.species import SpeciesState

pytestmark = pytest.mark.newest

MOST, POPULATION, GENERATION = 5, 24, 40
SETTINGS = Species(most=MOST, stagnation=3, survival=0.4)
_survive = jax.jit(lambda species, fitness: survive(SETTINGS, species, fitness, jnp.asarray(GENERATION, jnp.int32)))
_parents = jax.jit(lambda key, species, fitness: choose_parents(key, SETTINGS, species, fitness))


def _species(
    member_of: list[int], best: list[float] | None = None, improved_at: list[int] | None = None, most: int = MOST
) -> SpeciesState:
    """Return species with these members; each one's centre is a genome whose key is its place."""
    count = max(member_of) + 1
    rest = [0] * (most - count)
    return SpeciesState(
        centres=stacked([made([place], {}, capacity=(1, 1)) for place in range(most)]),
        count=np.int32(count),
        best=np.array([*(best or [0.0] * count), *rest], np.float32),
        improved_at=np.array([*(improved_at or [GENERATION] * count), *rest], np.int32),
        size=np.bincount(member_of, minlength=most).astype(np.int32),
        member_of=np.array(member_of, np.int32),
    )


@st.composite
def situations(draw: st.DrawFn) -> tuple[list[int], list[float], list[float], list[int]]:
    """Draw members, fitness, best fitness and time of it: few values, so that ties abound."""
    count = draw(st.integers(1, MOST))
    rest = draw(st.lists(st.integers(0, count - 1), min_size=POPULATION - count, max_size=POPULATION - count))
    member_of = draw(st.permutations([*range(count), *rest]))
    fitness = draw(st.lists(st.sampled_from([-np.inf, 0.0, 1.0, 2.0, 3.0]), min_size=POPULATION, max_size=POPULATION))
    best = draw(st.lists(st.sampled_from([-np.inf, 0.0, 1.0, 2.0, 4.0]), min_size=count, max_size=count))
    improved_at = draw(st.lists(st.integers(GENERATION - 5, GENERATION - 1), min_size=count, max_size=count))
    return list(member_of), fitness, best, improved_at


@settings(max_examples=150, deadline=None)
@given(situations())
def test_species_survive_and_are_sorted_as_in_the_reference(situation: Any) -> None:
    member_of, fitness, best, improved_at = situation
    before = _species(member_of, best, improved_at)
    after = jax.device_get(_survive(before, np.array(fitness, np.float32)))
    known = records(before, int(before.count))
    wanted = reference.survive(known, fitness, GENERATION, SETTINGS.stagnation, SETTINGS.exempt)
    count = int(after.count)
    assert count == len(wanted) >= 1
    assert after.centres.nodes.key[:count, 0].tolist() == list(wanted)
    assert after.best[:count].tolist() == [record.best for record in wanted.values()]
    assert after.improved_at[:count].tolist() == [record.improved_at for record in wanted.values()]
    assert after.size.tolist() == [len(r.members) for r in wanted.values()] + [0] * (MOST - count)
    assert {i: r.members for i, r in records(after, MOST).items() if i < count} == {
        i: record.members for i, record in enumerate(wanted.values())
    }


def _offspring(sizes: list[int], population: int, chosen: Species) -> list[int]:
    member_of = [place for place, size in enumerate(sizes) for _ in range(size)]
    species = _species(member_of, most=chosen.most)
    return np.asarray(offspring(chosen, species, population)).tolist()[: len(sizes)]


def test_offspring_of_the_worked_example() -> None:
    assert _offspring([40, 24], 64, SETTINGS) == [42, 22]


@settings(max_examples=60, deadline=None)
@given(st.data(), st.integers(1, 12), st.integers(24, 300), st.sampled_from([0.0, 0.25, 0.5, 1.0]))
def test_offspring_are_the_references_and_add_up(data: Any, count: int, population: int, change: float) -> None:
    """Sizes may fall short of the population: members of species that died have none."""
    total = data.draw(st.integers(count, population))
    cuts = data.draw(st.sets(st.integers(1, total), min_size=count - 1, max_size=count - 1)) - {total}
    sizes = np.diff([0, *sorted(cuts), total]).tolist()
    children = _offspring(sizes, population, Species(most=12, change=change))
    assert children == reference.offspring(sizes, population, change)
    assert sum(children) == population
    assert min(children) >= 1


def test_the_papers_fifty_species_of_five_thousand_get_what_fractions_say() -> None:
    sizes = [100] * 50
    assert _offspring(sizes, 5_000, Species()) == reference.offspring(sizes, 5_000)


def test_children_of_200_generations_stand_where_the_reference_puts_them(history: History) -> None:
    """A species' block begins with its elites: its best, of equals the newest, to the bit."""
    chosen, elites, single = history.settings.species, 0, 0
    for generation, drawn in enumerate(history.fitness):
        fitness = np.nan_to_num(drawn, nan=-np.inf).tolist()
        kept = list(history.survivors(generation).values())
        counts = reference.offspring([len(r.members) for r in kept], len(fitness), chosen.change)
        before, after, child = history.at(generation).genomes, history.at(generation + 1).genomes, 0
        for record, count in zip(kept, counts, strict=True):
            carried = reference.ranked(record.members, fitness)[: min(chosen.elites, count)]
            single += len(record.members) == 1 < count
            for place, parent in enumerate(carried):
                assert same(at(after, child + place), at(before, parent))
                elites += 1
            child += count
    assert elites > 1000
    assert single > 10, "too few species had one member and more children"


@settings(max_examples=80, deadline=None)
@given(situations(), st.integers(0, 2**31 - 1))
def test_parents_are_the_best_of_their_childs_species(situation: Any, seed: int) -> None:
    member_of, fitness, _, _ = situation
    species = _species(member_of)
    parents = jax.device_get(_parents(jax.random.key(seed), species, np.array(fitness, np.float32)))
    known, child = list(records(species, int(species.count)).values()), 0
    counts = reference.offspring([len(record.members) for record in known], POPULATION)
    for record, count in zip(known, counts, strict=True):
        best, best_first = reference.pool(record.members, fitness, 0.4), reference.ranked(record.members, fitness)
        for place in range(count):
            fitter, other, elite = (leaf[child + place] for leaf in (parents.fitter, parents.other, parents.elite))
            assert elite == (place < min(2, len(record.members)))
            if elite:
                assert fitter == other == best_first[place]
            else:
                assert fitter in best
                assert other in best
                assert fitness[fitter] >= fitness[other]
        child += count


def test_every_parent_of_a_species_is_drawn_as_often_and_both_independently() -> None:
    """Nine of the 24 members of one species are parents; all are as fit, so that the first draw is the fitter."""
    species, fitness = _species([0] * POPULATION), jnp.zeros(POPULATION)
    keys = jax.random.split(jax.random.key(5), 400)
    parents = jax.device_get(jax.jit(jax.vmap(_parents, (0, None, None)))(keys, species, fitness))
    fitter, other = parents.fitter[:, 2:].ravel(), parents.other[:, 2:].ravel()
    best = reference.pool(range(POPULATION), [0.0] * POPULATION, 0.4)
    assert best == list(range(23, 14, -1))
    for parent in best:
        assert binomtest(int((fitter == parent).sum()), len(fitter), 1 / 9).pvalue > 1e-4
        assert binomtest(int((other == parent).sum()), len(other), 1 / 9).pvalue > 1e-4
    assert binomtest(int((fitter == other).sum()), len(fitter), 1 / 9).pvalue > 1e-4


@pytest.mark.parametrize("survival", [0.01, 1.0])
def test_at_least_one_member_and_at_most_all_are_parents(survival: float) -> None:
    species, fitness = _species([0] * POPULATION), jnp.arange(float(POPULATION))
    chosen = Species(most=MOST, survival=survival)
    keys = jax.random.split(jax.random.key(1), 40)
    drawn = jax.vmap(lambda key, *given: choose_parents(key, chosen, *given), (0, None, None))
    parents = jax.jit(drawn)(keys, species, fitness)
    children = np.concatenate([np.asarray(parents.fitter)[:, 2:], np.asarray(parents.other)[:, 2:]])
    assert set(children.ravel().tolist()) == set(reference.pool(range(POPULATION), range(POPULATION), survival))
