"""Structural mutations on genomes small enough to work out by hand, and on any others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from genomes import CONNECTIONS, NODES, at, check, dags, made, read, read_all, same
from hypothesis import given, settings
from hypothesis import strategies as st
from reference import Genes, Node
from scipy.stats import binomtest

from evoclaims.methods.neat.mutation import (
    add_connection,
    add_node,
    delete_connection,
    delete_node,
    mutate_structure,
)
from evoclaims.methods.neat.settings import Mutation
from evoclaims.networks.genome import Genome

pytestmark = pytest.mark.newest

INPUTS, OUTPUTS, NEW = 2, 2, 2**24 + 1
_add_node = jax.jit(lambda u, genome, new_key, happens=True: add_node(happens, u, genome, new_key))
_delete_node = jax.jit(lambda u, genome, happens=True: delete_node(happens, u, genome, INPUTS, OUTPUTS))
_add_connection = jax.jit(lambda u, v, genome, happens=True: add_connection(happens, u, v, genome, INPUTS))
_delete_connection = jax.jit(lambda u, genome, happens=True: delete_connection(happens, u, genome))
SOME = settings(max_examples=60, deadline=None)
HALF = Node(0.5, 2.0)
GENOME = made([0, 1, 7, 2, 9, 3], {(0, 7): 0.25, (7, 2): 0.5, (1, 2): -1.0, (2, 3): 2.0, (7, 9): 4.0}, {7: HALF})


def _u(choice: int, count: int) -> Any:
    """Return a number in [0, 1) that picks `choice` of `count`."""
    return np.float32((choice + 0.5) / count)


def _order(genome: Genome) -> list[int]:
    return np.asarray(genome.nodes.key)[: int(genome.node_count)].tolist()


def _places(genome: Genome) -> list[tuple[int, int, float]]:
    genes, count = genome.connections, int(genome.connection_count)
    columns = (np.asarray(leaf)[:count].tolist() for leaf in (genes.source, genes.target, genes.weight))
    return list(zip(*columns, strict=True))


def _by_key(genome: Genome) -> list[tuple[int, int, float]]:
    """Return the connections in their order, by the keys of their ends."""
    return [(_order(genome)[source], _order(genome)[target], weight) for source, target, weight in _places(genome)]


def _reached(genes: Genes, start: int) -> set[int]:
    """Return the keys that `start` leads to, itself among them."""
    found, left = {start}, [start]
    while left:
        key = left.pop()
        left += [target for source, target in genes.connections if source == key and target not in found]
        found.update(left)
    return found


def _new_key() -> Any:
    return np.int32(NEW)


@SOME
@given(dags(activations=2), st.data())
def test_a_node_splits_the_connection_that_was_picked(genome: Genome, data: Any) -> None:
    before = read(genome)
    count = len(before.connections)
    choice = data.draw(st.integers(0, max(count - 1, 0)))
    grown = _add_node(_u(choice, max(count, 1)), genome, _new_key())
    if not count or len(before.nodes) == NODES or count + 2 > CONNECTIONS:
        assert same(grown, genome)
        return
    links, order = _by_key(genome), _order(genome)
    source, target, weight = links[choice]
    assert _by_key(grown) == [*links[:choice], (source, NEW, 1.0), *links[choice + 1 :], (NEW, target, weight)]
    assert read(grown).nodes == {**before.nodes, NEW: Node(0.0, 1.0, 0)}
    assert _order(grown) == [*order[: order.index(target)], NEW, *order[order.index(target) :]]
    check(jax.tree.map(lambda leaf: leaf[None], grown), INPUTS, OUTPUTS, activations=2)


@pytest.mark.parametrize("weights", [{}, {(0, 2): 1.0}])
def test_no_node_is_added_without_a_connection_or_without_room(weights: Mapping[Any, float]) -> None:
    small = made([0, 1, 2, 3], {}, capacity=(8, 4))
    full_nodes = made([0, 1, 2, 3], weights, capacity=(4, 4))
    one_place_left = made([0, 1, 2, 3], {(0, 2): 1.0, (0, 3): 1.0, (1, 2): 1.0}, capacity=(8, 4))
    for genome in (small, full_nodes, one_place_left):
        assert same(_add_node(_u(0, 1), genome, _new_key()), genome)
    two_places_left = made([0, 1, 2, 3], {(0, 2): 1.0, (0, 3): 1.0}, capacity=(5, 4))
    assert int(_add_node(_u(0, 2), two_places_left, _new_key()).connection_count) == 3


@SOME
@given(dags(activations=2), st.data())
def test_the_hidden_node_that_was_picked_is_deleted(genome: Genome, data: Any) -> None:
    before, hidden = read(genome), [key for key in _order(genome) if key >= INPUTS + OUTPUTS]
    choice = data.draw(st.integers(0, max(len(hidden) - 1, 0)))
    shrunk = _delete_node(_u(choice, max(len(hidden), 1)), genome)
    if not hidden:
        assert same(shrunk, genome)
        return
    gone = hidden[choice]
    nodes = {key: node for key, node in before.nodes.items() if key != gone}
    assert read(shrunk) == Genes(nodes, {e: w for e, w in before.connections.items() if gone not in e})
    assert _order(shrunk) == [key for key in _order(genome) if key != gone]
    assert _by_key(shrunk) == [each for each in _by_key(genome) if gone not in each[:2]]
    check(jax.tree.map(lambda leaf: leaf[None], shrunk), INPUTS, OUTPUTS, activations=2)


@SOME
@given(dags(activations=2), st.data())
def test_a_connection_is_added_unless_it_is_there_closes_a_cycle_or_has_no_room(genome: Genome, data: Any) -> None:
    before, order = read(genome), _order(genome)
    s, t = data.draw(st.integers(0, len(order) - 1)), data.draw(st.integers(INPUTS, len(order) - 1))
    source, target = order[s], order[t]
    linked = _add_connection(_u(s, len(order)), _u(t - INPUTS, len(order) - INPUTS), genome)
    full = len(before.connections) == CONNECTIONS
    if full or (source, target) in before.connections or source in _reached(before, target):
        assert same(linked, genome)
        return
    assert read(linked) == Genes(before.nodes, {**before.connections, (source, target): 0.0})
    assert [ends for *ends, _ in _by_key(linked)] == [[*ends] for ends in (*before.connections, (source, target))]
    led_to, between = _reached(before, target), order[t : s + 1]  # what the target leads to moves behind the source
    moved = [*(key for key in between if key not in led_to), *(key for key in between if key in led_to)]
    assert _order(linked) == [*order[:t], *moved, *order[t + len(moved) :]]
    check(jax.tree.map(lambda leaf: leaf[None], linked), INPUTS, OUTPUTS, activations=2)


@SOME
@given(dags(), st.data())
def test_the_connection_that_was_picked_is_deleted(genome: Genome, data: Any) -> None:
    before = read(genome)
    count = len(before.connections)
    choice = data.draw(st.integers(0, max(count - 1, 0)))
    cut = _delete_connection(_u(choice, max(count, 1)), genome)
    if not count:
        assert same(cut, genome)
        return
    gone = list(before.connections)[choice]
    assert read(cut) == Genes(before.nodes, {e: w for e, w in before.connections.items() if e != gone})
    check(jax.tree.map(lambda leaf: leaf[None], cut), INPUTS, OUTPUTS)


@SOME
@given(dags(), st.floats(0, 1, exclude_max=True, width=32), st.floats(0, 1, exclude_max=True, width=32))
def test_a_mutation_that_does_not_happen_leaves_the_genome_as_it_is(genome: Genome, u: float, v: float) -> None:
    u, v, never = np.float32(u), np.float32(v), np.bool_(False)
    assert same(_add_node(u, genome, _new_key(), never), genome)
    assert same(_delete_node(u, genome, never), genome)
    assert same(_add_connection(u, v, genome, never), genome)
    assert same(_delete_connection(u, genome, never), genome)


@pytest.mark.parametrize("count", [1, 3, 100, 400])
def test_the_largest_random_number_picks_the_last(count: int) -> None:
    """1 - 2⁻²⁴ is the largest float32 below 1: nothing may round up to the count."""
    genome, weights = made([0, 1, 2, 3], {}, capacity=(4, count)), np.arange(1, count + 1, dtype=np.float32)
    full = replace(genome, connections=replace(genome.connections, weight=weights), connection_count=np.int32(count))
    cut = _delete_connection(np.nextafter(np.float32(1), np.float32(0)), full)
    assert np.asarray(cut.connections.weight).tolist() == [*range(1, count), 0]


@jax.jit
def _mutate(keys: Any, rates: Any, genome: Genome) -> Genome:
    """Mutate one genome with every key; the rates are data, so that this is compiled once."""
    settings = Mutation(*rates)
    new_key = jnp.asarray(NEW, jnp.int32)
    return jax.vmap(lambda key: mutate_structure(key, settings, genome, new_key, INPUTS, OUTPUTS))(keys)


def _mutants(rates: Sequence[float], genome: Genome, count: int = 2000) -> list[Genes]:
    """Return what becomes of a genome at these rates of its four mutations."""
    mutants = _mutate(jax.random.split(jax.random.key(11), 2000), jnp.array(rates), genome)
    check(mutants, INPUTS, OUTPUTS)
    return read_all(at(mutants, slice(count)))


def _rate(mutants: list[Genes], happened: Callable[[Genes], bool], rate: float) -> None:
    hits = sum(happened(each) for each in mutants)
    assert binomtest(hits, len(mutants), rate).pvalue > 1e-4, f"{hits} of {len(mutants)}, at a rate of {rate}"


def test_nodes_are_added_and_connections_deleted_at_their_rates_and_independently() -> None:
    add, cut = 0.2, 0.3
    mutants = _mutants((add, 0.0, 0.0, cut), GENOME)
    _rate(mutants, lambda g: NEW in g.nodes, add)
    _rate(mutants, lambda g: len(g.connections) - (NEW in g.nodes) == 4, cut)
    _rate(mutants, lambda g: NEW in g.nodes and len(g.connections) == 5, add * cut)
    for ends in read(GENOME).connections:
        alone = [g for g in mutants if NEW not in g.nodes and len(g.connections) == 4]
        _rate(alone, lambda g, ends=ends: ends not in g.connections, 1 / 5)
        split = [g for g in mutants if len(g.connections) == 6]
        _rate(split, lambda g, ends=ends: ends not in g.connections, 1 / 5)


def test_nodes_are_deleted_and_connections_added_at_their_rates() -> None:
    """Without a deletion, a connection is added for each pair that can take one: it decides how often."""
    delete, add = 0.1, 0.25
    mutants, before = _mutants((0.0, delete, add, 0.0), GENOME), read(GENOME)
    _rate(mutants, lambda g: 7 not in g.nodes, delete / 2)
    _rate(mutants, lambda g: 9 not in g.nodes, delete / 2)
    whole = [g for g in mutants if len(g.nodes) == 6]
    possible = [
        (s, t)
        for s in before.nodes
        for t in before.nodes
        if t >= INPUTS and (s, t) not in before.connections and s not in _reached(before, t)
    ]
    assert {ends for g in whole for ends in g.connections} - before.connections.keys() == set(possible)
    _rate(whole, lambda g: len(g.connections) == 6, add * len(possible) / 24)
    for ends in possible:
        _rate(whole, lambda g, ends=ends: ends in g.connections, add / 24)


def test_adding_and_deleting_depend_on_draws_of_their_own() -> None:
    """Only both, or neither, leave the counts as they are; a pair drawn for a connection seldom takes one."""
    nodes = _mutants((0.5, 0.5, 0.0, 0.0), GENOME)
    _rate(nodes, lambda g: len(g.nodes) == 7, 0.25)
    _rate(nodes, lambda g: len(g.nodes) == 5, 0.25)
    connections = _mutants((0.0, 0.0, 1.0, 0.5), GENOME)
    added = [g for g in connections if 0.0 in g.connections.values()]
    _rate(added, lambda g: len(g.connections) == 5, 5 / 11)  # a cut takes the new one every sixth time


def test_a_node_is_added_before_one_is_deleted_and_a_connection_before_one_is_deleted() -> None:
    """Each of the four is certain: the only hidden node is the new one, the only new connection is the only one."""
    both = _mutants((1.0, 1.0, 1.0, 1.0), made([0, 1, 2, 3], {(0, 2): 0.5}), 50)
    assert {frozenset(g.nodes) for g in both} == {frozenset({0, 1, 2, 3})}
    assert {len(g.connections) for g in both} == {0}
