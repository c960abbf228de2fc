"""Which genes of two genomes are homologous (Stanley and Miikkulainen 2002, §3.2), found without sorting."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any, Final

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.keys import streams
from evoclaims.core.pytree import pytree
from evoclaims.kernels import GroupKernel, one_kernel
from evoclaims.kernels.genomes.gpu_distance import Comparison
from evoclaims.kernels.genomes.homology import write_look_up, write_search
from evoclaims.methods.neat.settings import Species
from evoclaims.networks.genome import EMPTY, Connections, Genome, Nodes

Weights = Callable[[Genome, Array, Array], Array]
"""Returns the weights of a genome's connections between pairs of slots, or NaN; of a slot of -1, anything."""
LARGE: Final = 2_048
"""From so many genomes on, their arrays are turned, which takes GPUs less time than reading each genome for itself with
5,000, and more with 1,024; between them nothing was measured."""
STEP: Final = 4
"""Numbers that a GPU's thread compares at a time."""
NOWHERE: Final = -1
"""Is looked for in place of a connection that the other genome cannot have."""
VACANT: Final = -2
"""Stands where a list has no connection; no connection is numbered so, nor is `NOWHERE`."""


@pytree
class Counterparts:
    """For each gene of one genome, the homologous gene of another.

    Attributes:
        nodes: the other's node genes; arbitrary where there is no counterpart.
        has_node: whether a node has a counterpart.
        weight: the weight of the other's connection; NaN without one.
    """

    nodes: Nodes
    has_node: Bool[Array, " nodes"]
    weight: Float[Array, " connections"]

    @property
    def has_connection(self) -> Bool[Array, " connections"]:
        """Whether a connection has a counterpart."""
        return ~jnp.isnan(self.weight)


def counterparts(genome: Genome, other: Genome) -> Counterparts:
    """Find the counterparts of `genome`'s genes in `other`, which many genomes of a batch have in common."""
    return _found(_by_matrix, genome, other)


def counterparts_in_pairs(genome: Genome, other: Genome) -> Counterparts:
    """Find the counterparts of `genome`'s genes in `other`, where each genome of a batch has its own."""
    return _found(_by_comparison, genome, other)


def _found(weights: Weights, genome: Genome, other: Genome) -> Counterparts:
    """Find counterparts; where no kernel does it all, `weights` finds those of connections."""
    search = _search(weights, genome.nodes.key.shape[-1], genome.connections.weight.shape[-1])
    genes = genome.connections
    own = genome.nodes.key, genes.source, genes.target, genome.node_count, genome.connection_count
    slot, bias, response, activation, weight = search(*jax.tree.leaves(other), *own)
    nodes = Nodes(key=genome.nodes.key, bias=bias, response=response, activation=activation)
    return Counterparts(nodes=nodes, has_node=slot >= 0, weight=weight)


@cache
def _search(weights: Weights, nodes: int, connections: int) -> GroupKernel:
    """Return the kernel that finds counterparts in genomes of a capacity; genomes with the same other are a group."""
    (slots, places, one), (of_nodes, of_connections) = (
        [jax.ShapeDtypeStruct(shape, dtype) for shape in shapes]
        for shapes, dtype in ((((nodes,), (connections,), ()), jnp.int32), (((nodes,), (connections,)), jnp.float32))
    )
    return GroupKernel(
        name="The breeding of genomes",
        function=partial(_searched, weights),
        groups=(slots, of_nodes, of_nodes, slots, places, places, of_connections, one, one),
        rows=(slots, places, places, one, one),
        outputs=(slots, of_nodes, of_nodes, slots, of_connections),
        write=partial(write_search, (nodes, connections)),
        one_lane=True,
        for_gpus=False,
    )


def _searched(weights: Weights, *leaves: Array) -> list[Array]:
    """Return the other's slot of each node or -1, its bias, response and activation, and each connection's weight."""
    other = Genome(Nodes(*leaves[:4]), Connections(*leaves[4:7]), *leaves[7:9])
    key, source, target, node_count, connection_count = leaves[9:]
    size = key.shape[0]
    has_node, has_connection = jnp.arange(size) < node_count, jnp.arange(source.shape[0]) < connection_count
    found: Int[Array, " nodes"] = jax.vmap(_slot, (0, None))(key, other.nodes.key)
    slot = jnp.where(has_node, found, -1)
    from_slot, to_slot = jnp.where(has_connection, slot[source], -1), slot[target]
    there = (from_slot >= 0) & (to_slot >= 0)
    weight = jnp.where(there, weights(other, from_slot, to_slot), jnp.nan)
    return [slot, *(leaf[slot] for leaf in leaves[1:4]), weight]


def _place(number: Int[Array, ""], numbers: Int[Array, " places"]) -> Int[Array, ""]:
    """Return where a number is among others, the last place if there are several; -1 if it is not."""
    return jnp.max(jnp.where(numbers == number, jnp.arange(numbers.shape[0], dtype=jnp.int32), -1))


_slot = one_kernel(_place, "The search for homologous nodes")


def _by_matrix(
    other: Genome, source: Int[Array, " connections"], target: Int[Array, " connections"]
) -> Float[Array, " connections"]:
    """Look weights up in the matrix of all pairs of slots."""
    weights: Float[Array, " connections"] = _matrix(other)[target, source]
    return weights


def _matrix(genome: Genome) -> Float[Array, "nodes nodes"]:
    """Return the weights of a genome's connections by slots, [target, source]; NaN where there is none."""
    size, genes = genome.nodes.key.shape[0], genome.connections
    place = jnp.where(genome.has_connection, genes.target, size)
    matrix: Float[Array, "nodes nodes"] = (
        jnp.full((size, size), jnp.nan).at[place, genes.source].set(genes.weight, mode="drop")
    )
    return matrix


def _by_comparison(
    other: Genome, source: Int[Array, " connections"], target: Int[Array, " connections"]
) -> Float[Array, " connections"]:
    """Compare each pair of slots with all connections: a matrix for each genome would be several times its size."""
    size, genes = other.nodes.key.shape[0], other.connections
    kernel = _look_up(genes.weight.shape[0])
    if not kernel.supported:
        return _by_matrix(other, source, target)
    links = jnp.where(other.has_connection, genes.target * size + genes.source, VACANT)
    full = jnp.pad(links, (0, -links.shape[0] % STEP), constant_values=VACANT)
    wanted = jnp.where((source >= 0) & (target >= 0), target * size + source, NOWHERE)
    (weights,) = jax.vmap(kernel, (None, None, None, 0))(full, genes.weight, other.connection_count, wanted)
    return weights


@cache
def _look_up(connections: int) -> GroupKernel:
    """Return the kernel that finds a number among a genome's, up to a count, and returns the weight there, or NaN.

    Places from the count on must hold `VACANT`; for `NOWHERE` the result is NaN.
    """
    one, full = (jax.ShapeDtypeStruct(shape, jnp.int32) for shape in ((), (connections + -connections % STEP,)))
    weights, weight = (jax.ShapeDtypeStruct(shape, jnp.float32) for shape in ((connections,), ()))

    def function(links: Array, weights: Array, count: Array, link: Array) -> list[Array]:
        place = _place(link, links)
        return [jnp.where(place >= 0, weights[place], jnp.nan)]

    write = partial(write_look_up, STEP, NOWHERE)
    return GroupKernel(
        "The breeding of genomes", function, (full, weights, one), (one,), (weight,), write, one_lane=True
    )


def crossover(key: PRNGKeyArray, fitter: Genome, other: Genome) -> Genome:
    """Return a child with the fitter parent's structure; each attribute of a homologous gene is either parent's."""
    node_key, connection_key = streams(key, "node", "connection")
    found = counterparts_in_pairs(fitter, other)
    nodes, genes = fitter.nodes, fitter.connections
    coins = jax.random.bernoulli(node_key, shape=(nodes.key.shape[0], 3)) & found.has_node[:, None]
    coin = jax.random.bernoulli(connection_key, shape=genes.weight.shape) & found.has_connection
    return replace(
        fitter,
        nodes=Nodes(
            key=nodes.key,
            bias=jnp.where(coins[:, 0], found.nodes.bias, nodes.bias),
            response=jnp.where(coins[:, 1], found.nodes.response, nodes.response),
            activation=jnp.where(coins[:, 2], found.nodes.activation, nodes.activation),
        ),
        connections=replace(genes, weight=jnp.where(coin, found.weight, genes.weight)),
    )


def distance(settings: Species, genome: Genome, other: Genome) -> Float[Array, ""]:
    """Return the distance of nodes plus that of connections.

    Each is (c_disjoint · D + c_difference · Σ |Δ attributes|) / max(n₁, n₂), where D counts the genes without a
    counterpart and the sum is over homologous genes; 0 when neither genome has such genes.
    """
    found = counterparts(genome, other)
    nodes = genome.nodes
    node_difference = (
        jnp.abs(nodes.bias - found.nodes.bias)
        + jnp.abs(nodes.response - found.nodes.response)
        + (nodes.activation != found.nodes.activation).astype(jnp.float32)
    )
    weight_difference = jnp.abs(genome.connections.weight - found.weight)

    def part(has: Array, difference: Array, count: Array, other_count: Array) -> Array:
        shared = jnp.sum(has, dtype=jnp.int32)
        total = settings.disjoint * (count + other_count - 2 * shared).astype(jnp.float32)
        total += settings.difference * jnp.sum(jnp.where(has, difference, 0.0))
        return total / jnp.maximum(jnp.maximum(count, other_count), 1).astype(jnp.float32)

    return part(found.has_node, node_difference, genome.node_count, other.node_count) + part(
        found.has_connection, weight_difference, genome.connection_count, other.connection_count
    )


def arranged(population: Genome) -> Genome:
    """Return a population as `distances` takes it: a large one gene by gene, the last axis that of genomes."""
    if population.node_count.shape[0] < LARGE:
        return population
    by_gene: Genome = jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 0, -1), population)
    return by_gene


def distances(
    settings: Species, population: Genome, centres: Genome, count: Int[Array, ""]
) -> Float[Array, "places population"]:
    """Return each genome's distance to each of the first `count` centres, leaves [places, …]; inf to the others.

    For GPUs that run kernels: there all are compared at once. Sums are in another order than those of `distance`.
    The population is `arranged`.
    """
    nodes, connections = centres.nodes.key.shape[-1], centres.connections.weight.shape[-1]
    size = population.node_count.shape[0]
    places = centres.node_count.shape[0]
    comparison = Comparison(settings.disjoint, settings.difference, size, size >= LARGE, nodes, connections, STEP)
    kernel, given = _comparison(comparison, places), _compared_with(comparison, centres)
    pairs = jnp.arange(places * size, dtype=jnp.int32)
    (made,) = jax.vmap(lambda pair: kernel(*jax.tree.leaves(population), *given, count, pair))(pairs)
    distances: Float[Array, "places population"] = made.reshape(places, size)
    return distances


def _compared_with(of: Comparison, centres: Genome) -> list[Array]:
    """Return what the kernel is given of centres."""
    keys = jnp.pad(centres.nodes.key, ((0, 0), (0, of.keys - of.nodes)), constant_values=EMPTY)
    attributes = centres.nodes.bias, centres.nodes.response, centres.nodes.activation
    return [keys, *attributes, jax.vmap(_matrix)(centres), centres.node_count, centres.connection_count]


@cache
def _comparison(of: Comparison, places: int) -> GroupKernel:
    """Return the kernel that compares genomes with centres: a row is the number of a pair, centre by centre."""

    def shaped(dtype: Any, *shape: int) -> jax.ShapeDtypeStruct:
        return jax.ShapeDtypeStruct(shape, dtype)

    whole, numbers = partial(shaped, jnp.int32), partial(shaped, jnp.float32)
    size = of.population
    nodes, connections = ((n, size) if of.by_gene else (size, n) for n in (of.nodes, of.connections))
    genes = whole(*nodes), numbers(*nodes), numbers(*nodes), whole(*nodes)
    links = whole(*connections), whole(*connections), numbers(*connections)
    attributes = numbers(places, of.nodes), numbers(places, of.nodes), whole(places, of.nodes)
    centres = whole(places, of.keys), *attributes, numbers(places, of.nodes, of.nodes), whole(places), whole(places)
    return GroupKernel(
        name="The distances of genomes",
        function=partial(_compared, of),
        groups=(*genes, *links, whole(size), whole(size), *centres, whole()),
        rows=(whole(),),
        outputs=(numbers(),),
        write=of.write,
        one_lane=True,
    )


def _compared(of: Comparison, *leaves: Array) -> list[Array]:
    """Return the distance that the kernel finds."""
    population, (key, *attributes, matrix, nodes, connections, count, pair) = leaves[:9], leaves[9:]
    place, number = pair // of.population, pair % of.population
    own = [leaf[..., number] if of.by_gene else leaf[number] for leaf in population]
    genome = Genome(Nodes(*own[:4]), Connections(*own[4:7]), *own[7:])
    target, source = jnp.nonzero(~jnp.isnan(matrix[place]), size=of.connections, fill_value=0)
    genes = Connections(source.astype(jnp.int32), target.astype(jnp.int32), matrix[place, target, source])
    nodes_of = Nodes(key[place, : of.nodes], *(leaf[place] for leaf in attributes))
    centre = Genome(nodes_of, genes, nodes[place], connections[place])
    apart = distance(Species(disjoint=of.disjoint, difference=of.difference), genome, centre)
    return [jnp.where(place < count, apart, jnp.inf)]
