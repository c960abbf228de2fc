"""Populations over 200 generations: every genome is sound, and every key says where its node came from."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest
from genomes import at, check, same
from history import FIRST_KEY, History

from evoclaims.core.errors import UserError
from evoclaims.methods.neat.population import Population, first_population
from evoclaims.methods.neat.settings import Attribute, Mutation, Settings, Species

pytestmark = pytest.mark.newest

INITIAL = Settings(
    population=200,
    nodes=8,
    connections=12,
    activations=("tanh", "sin", "gauss"),
    mutation=Mutation(
        bias=Attribute(mean=0.5, std=2.0), response=Attribute(mean=-1.0, std=0.0), weight=Attribute(std=4.0, bound=3.0)
    ),
    species=Species(most=4),
)


def _hidden(history: History, generation: int) -> Any:
    keys = np.asarray(history.populations.genomes.nodes.key[generation])
    return [set(row[row >= history.inputs + history.outputs].tolist()) for row in keys]


def test_every_genome_of_every_generation_is_sound(history: History) -> None:
    genomes = history.populations.genomes
    check(genomes, history.inputs, history.outputs, bound=2.0, activations=len(history.settings.activations))
    assert genomes.node_count.max() == history.settings.nodes
    assert genomes.connection_count.max() == history.settings.connections
    assert genomes.node_count.min() == history.inputs + history.outputs
    assert (np.abs(genomes.connections.weight) == 2.0).any(), "no value has met its bound"


def test_a_new_key_appears_in_one_genome_and_a_lost_one_never_comes_back(history: History) -> None:
    size, before = history.settings.population, set[int]()
    for generation in range(len(history.fitness) + 1):
        hidden, first = _hidden(history, generation), FIRST_KEY + (generation - 1) * size
        new = [key for keys in hidden for key in keys - before]
        assert len(new) == len(set(new))
        assert all(first <= key < first + size for key in new)
        assert all(key == first + child for child, keys in enumerate(hidden) for key in keys - before)
        before = set().union(*hidden)


@pytest.fixture(scope="module")
def first() -> Population:
    """A first population of networks of three inputs and two outputs."""
    drawn: Population = jax.jit(lambda key: first_population(key, INITIAL, 3, 2))(jax.random.key(0))
    return drawn


def test_the_first_genomes_connect_every_input_to_every_output_with_values_of_their_own(first: Population) -> None:
    genomes = jax.device_get(first.genomes)
    check(genomes, 3, 2, activations=3)
    assert (np.asarray(genomes.node_count) == 5).all()
    assert (np.asarray(genomes.connection_count) == 6).all()
    for source, target in zip(genomes.connections.source[:, :6], genomes.connections.target[:, :6], strict=True):
        assert sorted(zip(source.tolist(), target.tolist(), strict=True)) == [(s, t) for s in range(3) for t in (3, 4)]
    bias, weight = np.asarray(genomes.nodes.bias[:, :5]), np.asarray(genomes.connections.weight[:, :6])
    assert abs(bias.mean() - 0.5) < 4 * 2.0 / np.sqrt(bias.size)
    assert abs(bias.std() - 2.0) < 0.15
    assert (np.asarray(genomes.nodes.response[:, :5]) == -1.0).all()
    assert np.abs(weight).max() == 3.0
    assert abs(np.mean(np.abs(weight) == 3.0) - 0.4533) < 0.06  # P(|N(0, 4²)| > 3)
    assert len(np.unique(bias)) > 0.95 * bias.size
    counts = np.bincount(np.asarray(genomes.nodes.activation[:, :5]).ravel(), minlength=3)
    assert counts.min() > 270  # of 1000, 333 expected


def test_the_first_population_is_one_species_around_its_first_genome(first: Population) -> None:
    species = first.species
    assert int(species.count) == 1
    assert np.asarray(species.size).tolist() == [200, 0, 0, 0]
    assert not np.asarray(species.member_of).any()
    assert np.isneginf(np.asarray(species.best)).all()
    assert same(at(species.centres, 0), at(first.genomes, 0))
    assert int(first.next_key) == 5


@pytest.mark.parametrize(("nodes", "connections"), [(7, 12), (8, 11)])
def test_a_smallest_network_that_does_not_fit_is_one_sentence(nodes: int, connections: int) -> None:
    settings = Settings(population=200, nodes=nodes, connections=connections, species=Species(most=4))
    with pytest.raises(UserError, match="starts with 8 nodes and 12 connections, but nodes="):
        first_population(jax.random.key(0), settings, 6, 2)
