"""Mutation of numbers: what each draw does, how often, and that capacity plays no part."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest
from genomes import made, same
from reference import Node
from scipy.stats import binomtest, kstest

from evoclaims.methods.neat.mutation import draw, mutate, mutate_values
from evoclaims.methods.neat.settings import Attribute, Mutation
from evoclaims.networks.genome import Genome, resized

pytestmark = pytest.mark.newest

KEYS = 300
ORDER = list(range(20))
PAIRS = [(s, t) for t in range(2, 20) for s in range(t)][:60]
"""Every attribute starts at a value that neither noise of 0.01 nor a new draw around 4 can be mistaken for."""
GENOME = made(ORDER, dict.fromkeys(PAIRS, -1.0), dict.fromkeys(ORDER, Node(1.0, 2.0, 1)), capacity=(24, 64))
TOLD_APART = Mutation(
    bias=Attribute(mean=4.0, std=0.05, power=0.01, mutate_rate=0.15, replace_rate=0.05),
    response=Attribute(mean=-4.0, std=0.05, power=0.01, mutate_rate=0.1, replace_rate=0.02),
    weight=Attribute(mean=4.0, std=0.05, power=0.01, mutate_rate=0.2, replace_rate=0.03),
    activation_replace=0.3,
)


@pytest.fixture(scope="module")
def mutants() -> Genome:
    """One genome mutated with many keys."""
    keys = jax.random.split(jax.random.key(3), KEYS)
    genome = jax.tree.map(jax.numpy.asarray, GENOME)
    mutated: Genome = jax.device_get(jax.jit(jax.vmap(lambda k: mutate_values(k, TOLD_APART, 3, genome)))(keys))
    return mutated


def _values(mutants: Genome) -> list[tuple[Any, float, Attribute]]:
    """Return each attribute's values [genomes, genes], what they were, and its settings."""
    return [
        (mutants.nodes.bias[:, :20], 1.0, TOLD_APART.bias),
        (mutants.nodes.response[:, :20], 2.0, TOLD_APART.response),
        (mutants.connections.weight[:, :60], -1.0, TOLD_APART.weight),
    ]


def _happens(hits: Any, rate: float) -> None:
    hits = np.asarray(hits)
    assert binomtest(int(hits.sum()), hits.size, rate).pvalue > 1e-4, f"{hits.mean()} at a rate of {rate}"


def test_noise_and_new_draws_come_at_their_rates_for_every_gene(mutants: Genome) -> None:
    for values, was, attribute in _values(mutants):
        noisy, new = (values != was) & (np.abs(values - was) < 0.1), np.abs(values - attribute.mean) < 0.5
        _happens(noisy, attribute.mutate_rate)
        _happens(new, attribute.replace_rate)
        assert (noisy | new | (values == was)).all(), "a value was both replaced and disturbed, or neither"
        for gene in range(values.shape[1]):
            assert binomtest(int(noisy[:, gene].sum()), KEYS, attribute.mutate_rate).pvalue > 1e-5


def test_noise_and_new_draws_are_normal(mutants: Genome) -> None:
    for values, was, attribute in _values(mutants):
        noise = (values - was)[(values != was) & (np.abs(values - was) < 0.1)]
        assert kstest(noise / attribute.power, "norm").pvalue > 1e-4
        new = values[np.abs(values - attribute.mean) < 0.5]
        assert kstest((new - attribute.mean) / attribute.std, "norm").pvalue > 1e-4


def test_attributes_of_a_gene_mutate_independently(mutants: Genome) -> None:
    """Whether and by how much."""
    bias, response = mutants.nodes.bias[:, :20], mutants.nodes.response[:, :20]
    one, other = (np.abs(bias - 1.0) < 0.1) & (bias != 1.0), (np.abs(response - 2.0) < 0.1) & (response != 2.0)
    _happens(one & other, 0.15 * 0.1)
    together = np.corrcoef((bias - 1.0)[one & other], (response - 2.0)[one & other])[0, 1]
    assert abs(together) < 0.4
    neighbours = (np.roll(one, 1, axis=1) & one)[:, 1:]
    _happens(neighbours, 0.15**2)


def test_activations_are_drawn_anew_at_their_rate_and_all_alike(mutants: Genome) -> None:
    activation = mutants.nodes.activation[:, :20]
    for function, rate in ((0, 0.1), (1, 0.8), (2, 0.1)):
        _happens(activation == function, rate)


def test_structure_and_empty_places_stay_as_they_are(mutants: Genome) -> None:
    assert (mutants.nodes.key == GENOME.nodes.key).all()
    assert (mutants.connections.source == GENOME.connections.source).all()
    assert (mutants.connections.target == GENOME.connections.target).all()
    for leaf in (mutants.nodes.bias, mutants.nodes.response, mutants.nodes.activation):
        assert (leaf[:, 20:] == 0).all()
    assert (mutants.connections.weight[:, 60:] == 0).all()


def test_with_one_function_no_activation_changes() -> None:
    once = jax.jit(lambda key: mutate_values(key, TOLD_APART, 1, jax.tree.map(jax.numpy.asarray, GENOME)))
    assert (np.asarray(once(jax.random.key(0)).nodes.activation) == GENOME.nodes.activation).all()


def test_each_number_is_disturbed_replaced_or_kept_by_its_uniform_draw() -> None:
    attribute = Attribute(mean=2.0, std=0.5, power=0.25, mutate_rate=0.25, replace_rate=0.25, bound=3.0)
    u = np.array([0.0, 0.2499, 0.25, 0.4999, 0.5, 0.9999, 0.1, 0.1, 0.3], np.float32)
    z = np.array([1.0, -1.0, 1.0, -2.0, 5.0, 5.0, 100.0, -100.0, 100.0], np.float32)
    values = np.array([1.0, 1.0, 1.0, 1.0, 1.0, -2.0, 1.0, 1.0, 1.0], np.float32)
    wanted = [1.25, 0.75, 2.5, 1.0, 1.0, -2.0, 3.0, -3.0, 3.0]
    assert np.asarray(mutate(attribute, values, u, z)).tolist() == wanted


def test_first_values_have_their_mean_and_spread_and_are_clipped() -> None:
    attribute = Attribute(mean=1.0, std=2.0, bound=4.0)
    values = np.asarray(draw(jax.random.key(1), attribute, 4000))
    assert np.abs(values).max() == 4.0
    inside = values[np.abs(values) < 4.0]
    _happens(values == 4.0, 0.0668)
    _happens(inside < 1.0, (0.5 - 0.00621) / (1 - 0.0668 - 0.00621))
    assert np.asarray(draw(jax.random.key(1), Attribute(mean=7.0, std=0.0), 3)).tolist() == [5.0] * 3


def test_capacity_is_no_part_of_what_is_drawn() -> None:
    wide, narrow = (draw(jax.random.key(4), Attribute(), size) for size in (64, 16))
    assert same(wide[:16], narrow)
    once = jax.jit(lambda genome: mutate_values(jax.random.key(4), TOLD_APART, 3, genome))
    wide, narrow = once(resized(GENOME, 40, 131)), once(resized(GENOME, 21, 61))
    assert same(resized(wide, 21, 61), narrow)
