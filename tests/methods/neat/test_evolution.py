"""One generation: who is champion, what is told, and what a new level changes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import reference
from genomes import at, read_all, same
from usual_fusions import USUAL_FUSIONS

from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.neat import capacity
from evoclaims.methods.neat.evolution import Evolution, Neat
from evoclaims.methods.neat.settings import Attribute, LevelUp, Mutation, Settings, Species
from evoclaims.networks.genome import resized

pytestmark = pytest.mark.newest

TASK, POPULATION, GENERATIONS = NParity(3), 24, 8
PEAK = 10.0
"""A record that no fitness on parity, at most 0, can beat."""


def _settings(on_level_up: LevelUp, nodes: int, connections: int) -> Settings:
    return Settings(
        population=POPULATION,
        nodes=nodes,
        connections=connections,
        mutation=Mutation(node_add=0.7, connection_add=0.7, weight=Attribute(mutate_rate=0.5)),
        species=Species(most=5, threshold=1.5, exempt=1, survival=0.4, on_level_up=on_level_up),
    )


@dataclass(frozen=True)
class Bench:
    """A compiled generation, and the states and reports of some of them on the first level."""

    step: Any
    states: list[Evolution]
    reports: list[Any]


def _bench(settings: Settings) -> Bench:
    keys = jax.random.split(jax.random.key(8), GENERATIONS)

    method = Neat(settings)

    def generation(key: Any, level: Any, state: Evolution) -> Any:
        return method.step(key, TASK, level, state)

    with jax.numpy_dtype_promotion("strict"), jax.numpy_rank_promotion("raise"), jax.debug_key_reuse(True):
        state = jax.jit(lambda key: method.init(key, TASK))(jax.random.key(2))
        level = jnp.zeros((), jnp.int32)
        step = jax.jit(generation).lower(keys[0], level, state).compile(USUAL_FUSIONS)
    states, reports = [state], []
    for key in keys:
        state, progress = step(key, level, state)
        states.append(state)
        reports.append(progress)
    return Bench(step, *jax.device_get((states, reports)))


@pytest.fixture(scope="module")
def resetting() -> Bench:
    """All genomes in arrays of the largest size."""
    return _bench(_settings("reset", 16, 64))


@pytest.fixture(scope="module")
def keeping() -> Bench:
    """Larger limits, and arrays that grow with the genomes: small ones, and in the end the largest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(capacity, "SMALLER", ((7, 12),))
        return _bench(_settings("keep", 32, 128))


def _fitted(state: Evolution) -> Evolution:
    """Cut a state's genomes to the smaller limits."""
    population, species = state.population, state.population.species
    return replace(
        state,
        population=replace(
            population,
            genomes=resized(population.genomes, 16, 64),
            species=replace(species, centres=resized(species.centres, 16, 64)),
        ),
        champion=resized(state.champion, 16, 64),
    )


def test_limits_and_growing_arrays_are_no_part_of_the_result(resetting: Bench, keeping: Bench) -> None:
    """To the bit, until a genome meets a limit; the treatment of new levels does not matter on the first."""
    nodes = [int(state.population.genomes.node_count.max()) for state in keeping.states]
    assert min(nodes) + 1 <= 7 < max(nodes) < 16
    assert len({int(state.population.species.count) for state in keeping.states}) > 1
    for one, other in zip(resetting.states, keeping.states, strict=True):
        assert same(one, _fitted(other))
    assert same(resetting.reports, keeping.reports)


def test_trials_side_by_side_work_in_the_smallest_arrays_that_fit_all(keeping: Bench) -> None:
    """A kernel of smaller arrays, if it ran for all and its results were not used, would write behind them."""
    sizes = [(7, 12), (32, 128)]

    def used(*genomes: Any) -> Any:
        return capacity.in_capacity(sizes, genomes, lambda nodes, _: jnp.int32(nodes))

    for places, wanted in (((0, 1), 7), ((0, -1), 32), ((-1, -1), 32)):
        some = [keeping.states[place].population.genomes for place in places]
        nested = jax.tree.map(lambda *leaf: np.stack(leaf)[:, None], *some)
        assert np.unique(jax.vmap(jax.vmap(used))(nested)).tolist() == [wanted]


def test_the_champion_is_the_best_of_its_generation_and_of_equals_the_newest(resetting: Bench) -> None:
    rows, ties = TASK.table.inputs[:4].astype(np.float64), 0
    for before, after, progress in zip(resetting.states, resetting.states[1:], resetting.reports, strict=False):
        genomes = before.population.genomes
        answers = np.array([reference.forward(genes, rows, 1)[:, 0] > 0 for genes in read_all(genomes)])
        right = np.mean(answers == (rows.sum(axis=1) % 2 == 1), axis=1)
        best = max(np.flatnonzero(right == right.max()))
        ties += np.sum(right == right.max()) > 1
        assert same(after.champion, at(genomes, best))
        assert float(progress.fitness) == float(after.episode.fitness) == right.max() - 1.0
        assert float(progress.success) == float(after.episode.success) == right.max()
        assert bool(progress.healthy)
    assert ties


def test_the_metrics_are_the_means_of_the_generation_that_was_evaluated(resetting: Bench) -> None:
    for before, after, progress in zip(resetting.states, resetting.states[1:], resetting.reports, strict=False):
        genomes = before.population.genomes
        wanted = {
            "nodes": genomes.node_count.mean(),
            "connections": genomes.connection_count.mean(),
            "champion_nodes": after.champion.node_count,
            "champion_connections": after.champion.connection_count,
            "species": before.population.species.count,
        }
        assert progress.metrics.keys() == wanted.keys()
        for name, value in wanted.items():
            np.testing.assert_allclose(progress.metrics[name], value, rtol=1e-6)


def test_nobody_is_champion_before_the_first_evaluation(resetting: Bench) -> None:
    start = resetting.states[0]
    assert same(start.champion, at(start.population.genomes, 0))
    assert np.isneginf(start.episode.fitness)


def _three_stagnant_species(bench: Bench) -> Evolution:
    """Return a state whose species all had their records long ago."""
    state = bench.states[0]
    species = replace(
        state.population.species,
        count=np.int32(3),
        best=np.array([PEAK, PEAK, PEAK, -np.inf, -np.inf], np.float32),
        improved_at=np.zeros(5, np.int32),
        size=np.array([8, 8, 8, 0, 0], np.int32),
        member_of=np.arange(POPULATION, dtype=np.int32) % 3,
    )
    return replace(state, population=replace(state.population, species=species, generation=np.int32(20)))


def _survivors(bench: Bench, level: int) -> list[float]:
    """Return the records of the species that outlive a generation on `level`."""
    state, _ = bench.step(jax.random.key(1), jnp.asarray(level, jnp.int32), _three_stagnant_species(bench))
    species = state.population.species
    best = np.asarray(species.best)[: int(species.count)]
    new = np.isneginf(best)
    assert int(state.level) == level
    assert (np.asarray(species.improved_at)[: len(best)] == np.where(best == PEAK, 0, 21)).all()
    return best[~new].tolist()


def test_stagnant_species_die_on_the_level_that_they_stagnate_on(resetting: Bench, keeping: Bench) -> None:
    assert _survivors(resetting, 0) == [PEAK]
    assert _survivors(keeping, 0) == [PEAK]


def test_a_new_level_forgives_stagnation_or_kills_for_it(resetting: Bench, keeping: Bench) -> None:
    forgiven = _survivors(resetting, 1)
    assert len(forgiven) == 3
    assert max(forgiven) <= 0.0
    assert _survivors(keeping, 1) == [PEAK]
