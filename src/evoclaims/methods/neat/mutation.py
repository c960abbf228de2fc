"""Mutation: of structure (Stanley and Miikkulainen 2002, §3.1), and of the numbers in genes (TensorNEAT).

Every mutation maps one genome to one genome and keeps the slots in topological order. Whether it happens is an
argument, so that kernels can pass over the genomes to which it does not.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.keys import streams
from evoclaims.core.pytree import select
from evoclaims.kernels import GroupKernel
from evoclaims.kernels.genomes.structure import PASSED_OVER, ordering_kernel, removal_kernel
from evoclaims.methods.neat.settings import Attribute, Mutation
from evoclaims.networks.genome import EMPTY, Connections, Genome, Nodes


def mutate_structure(
    key: PRNGKeyArray, settings: Mutation, genome: Genome, new_key: Int[Array, ""], inputs: int, outputs: int
) -> Genome:
    """Add a node, delete a node, add a connection, delete a connection, each with its own probability.

    `new_key` is the historical marking of an added node; it must be unique.
    """
    # All draws in one call: they are few, and each generator call costs compile time.
    happens, which = jnp.split(jax.random.uniform(key, (9,)), [4])
    genome = add_node(happens[0] < settings.node_add, which[0], genome, new_key)
    genome = delete_node(happens[1] < settings.node_delete, which[1], genome, inputs, outputs)
    genome = add_connection(happens[2] < settings.connection_add, which[2], which[3], genome, inputs)
    return delete_connection(happens[3] < settings.connection_delete, which[4], genome)


def add_node(happens: Bool[Array, ""], u: Float[Array, ""], genome: Genome, new_key: Int[Array, ""]) -> Genome:
    """Split the connection that `u` in [0, 1) picks: in-weight 1, out-weight the old one.

    The new node has bias 0, response 1 and the first function. Nothing happens without a connection, or without room
    for a node and two connections.
    """
    nodes, genes = genome.nodes, genome.connections
    slots, places = jnp.arange(nodes.key.shape[0]), jnp.arange(genes.weight.shape[0])
    chosen = _pick(u, genome.connection_count)
    split = places == chosen
    room = (genome.node_count < slots.size) & (genome.connection_count + 2 <= places.size)
    # The new node takes its target's slot; the target and all after it move up by one.
    slot, weight = (jnp.sum(jnp.where(split, leaf, 0)) for leaf in (genes.target, genes.weight))

    def insert(leaf: Array, value: Array | float) -> Array:
        return jnp.where(slots < slot, leaf, jnp.where(slots == slot, value, jnp.roll(leaf, 1)))

    new = places == genome.connection_count
    source, target = genes.source + _one_if(genes.source >= slot), genes.target + _one_if(genes.target >= slot)
    grown = Genome(
        nodes=Nodes(
            key=insert(nodes.key, new_key),
            bias=insert(nodes.bias, 0.0),
            response=insert(nodes.response, 1.0),
            activation=insert(nodes.activation, 0),
        ),
        connections=Connections(
            source=jnp.where(new, slot, source),
            target=jnp.where(new, slot + 1, jnp.where(split, slot, target)),
            weight=jnp.where(new, weight, jnp.where(split, 1.0, genes.weight)),
        ),
        node_count=genome.node_count + 1,
        connection_count=genome.connection_count + 1,
    )
    return select(happens & (genome.connection_count > 0) & room, grown, genome)


def delete_node(happens: Bool[Array, ""], u: Float[Array, ""], genome: Genome, inputs: int, outputs: int) -> Genome:
    """Delete the hidden node that `u` in [0, 1) picks, with its connections; without hidden nodes, do nothing."""
    nodes = genome.nodes
    slots = jnp.arange(nodes.key.shape[0])
    chosen = _pick(u, genome.node_count - inputs - outputs)
    slot, connections, left = without_node(happens, chosen, genome, inputs + outputs)

    def remove(leaf: Array, empty: int) -> Array:
        moved = jnp.where(slots < slot, leaf, jnp.roll(leaf, -1))
        return jnp.where(slots < genome.node_count - 1, moved, empty)

    shrunk = Genome(
        nodes=Nodes(
            key=remove(nodes.key, EMPTY),
            bias=remove(nodes.bias, 0),
            response=remove(nodes.response, 0),
            activation=remove(nodes.activation, 0),
        ),
        connections=connections,
        node_count=genome.node_count - 1,
        connection_count=left,
    )
    return select(happens & (slot >= 0), shrunk, genome)


def without_node(
    happens: Bool[Array, ""], chosen: Int[Array, ""], genome: Genome, visible: int
) -> tuple[Int[Array, ""], Connections, Int[Array, ""]]:
    """Return the slot of hidden node number `chosen`, all connections but that node's in their order, and how many.

    Keys from `visible` on are those of hidden nodes. Sources and targets are slots without the node. If there is
    no such node, or it does not happen, the slot is -1 and there are no connections.
    """
    genes = genome.connections
    kernel = _removal(genome.nodes.key.shape[0], genes.weight.shape[0], visible)
    count = jnp.where(happens, genome.connection_count, PASSED_OVER)
    slot, left, *moved = kernel(genome.nodes.key, genes.source, genes.target, genes.weight, count, chosen)
    places = jnp.arange(genes.weight.shape[0])
    connections = Connections(*(jnp.where(places < left, leaf, jnp.zeros((), leaf.dtype)) for leaf in moved))
    return slot, connections, left


@cache
def _removal(nodes: int, connections: int, visible: int) -> GroupKernel:
    """Return the kernel of `without_node`."""

    def function(key: Array, source: Array, target: Array, weight: Array, count: Array, chosen: Array) -> list[Array]:
        hidden = key >= visible
        is_it = (count != PASSED_OVER) & hidden & (jnp.cumsum(hidden, dtype=jnp.int32) == chosen + 1)
        slot = jnp.where(jnp.any(is_it), jnp.argmax(is_it).astype(jnp.int32), -1)
        kept = (jnp.arange(connections) < count) & (source != slot) & (target != slot) & (slot >= 0)
        place = jnp.where(kept, jnp.cumsum(kept, dtype=jnp.int32) - 1, connections)
        moved = source - _one_if(source > slot), target - _one_if(target > slot), weight
        left = [jnp.zeros_like(leaf).at[place].set(leaf, mode="drop") for leaf in moved]
        return [slot, jnp.sum(kept, dtype=jnp.int32), *left]

    return removal_kernel(nodes, connections, visible, function)


def add_connection(
    happens: Bool[Array, ""], u: Float[Array, ""], v: Float[Array, ""], genome: Genome, inputs: int
) -> Genome:
    """Try once to connect two nodes, with weight 0.

    `u` and `v` in [0, 1) pick the source from all nodes, and the target from those that are not inputs. Nothing happens
    when the connection exists, would close a cycle, or has no room.
    """
    source, target = _pick(u, genome.node_count), inputs + _pick(v, genome.node_count - inputs)
    genes = genome.connections
    exists = jnp.any((genes.source == source) & (genes.target == target) & genome.has_connection)
    room = genome.connection_count < genes.weight.shape[0]
    cycle, place, origin = order_for(happens, source, target, genome)
    ordered = reordered(genome, place, origin)
    new = jnp.arange(genes.weight.shape[0]) == genome.connection_count
    linked = replace(
        ordered,
        connections=Connections(
            source=jnp.where(new, place[source], ordered.connections.source),
            target=jnp.where(new, place[target], ordered.connections.target),
            weight=jnp.where(new, 0.0, ordered.connections.weight),
        ),
        connection_count=genome.connection_count + 1,
    )
    return select(happens & ~exists & room & ~cycle, linked, genome)


def order_for(
    happens: Bool[Array, ""], source: Int[Array, ""], target: Int[Array, ""], genome: Genome
) -> tuple[Bool[Array, ""], Int[Array, " nodes"], Int[Array, " nodes"]]:
    """Return whether a link would close a cycle, each slot's new place if not, and each place's present slot.

    If it does not happen, nothing moves.
    """
    genes, slots = genome.connections, jnp.arange(genome.nodes.key.shape[0], dtype=jnp.int32)
    kernel = _ordering(slots.shape[0], genes.weight.shape[0])
    count = jnp.where(happens, genome.connection_count, PASSED_OVER)
    cycle, *moved = kernel(genes.source, genes.target, count, source, target)
    between = happens & (slots >= target) & (slots <= source)
    # Without the barrier, XLA computes a place anew for each connection that asks for it.
    place, origin = jax.lax.optimization_barrier(tuple(jnp.where(between, leaf, slots) for leaf in moved))
    return cycle > 0, place, origin


@cache
def _ordering(nodes: int, connections: int) -> GroupKernel:
    """Return the kernel of `order_for`."""

    def function(source: Array, target: Array, count: Array, start: Array, end: Array) -> list[Array]:
        downstream = descendants(nodes, source, target, count, end)
        place = position_after(downstream, end, start)
        origin = jnp.zeros_like(place).at[place].set(jnp.arange(nodes, dtype=jnp.int32))
        return [_one_if(downstream[start] & (count != PASSED_OVER)), place, origin]

    return ordering_kernel(nodes, connections, function)


def descendants(
    nodes: int,
    source: Int[Array, " connections"],
    target: Int[Array, " connections"],
    count: Int[Array, ""],
    start: Int[Array, ""],
) -> Bool[Array, " nodes"]:
    """Return which of the slots `start` leads to, itself included, along the first `count` connections."""
    there = jnp.arange(source.shape[0]) < count
    linked = jnp.zeros((nodes, nodes), bool).at[jnp.where(there, target, nodes), source].set(True, mode="drop")

    def visit(slot: Array, reached: Array) -> Array:
        return reached.at[slot].set(reached[slot] | jnp.any(linked[slot] & reached))

    reached: Bool[Array, " nodes"] = jax.lax.fori_loop(0, nodes, visit, jnp.arange(nodes) == start)
    return reached


def position_after(
    downstream: Bool[Array, " nodes"], target: Int[Array, ""], source: Int[Array, ""]
) -> Int[Array, " nodes"]:
    """Return each slot's new place, such that `source` comes before `target` (Pearce and Kelly 2006, §3).

    Among the slots from `target` to `source`, those that `target` does not lead to move to the front; both parts keep
    their order. If target is after source, nothing moves. `downstream`: what `target` leads to, without `source`.
    """
    slots = jnp.arange(downstream.shape[0], dtype=jnp.int32)
    between = (slots >= target) & (slots <= source)
    ahead = between & ~downstream
    before = jnp.cumsum(ahead, dtype=jnp.int32) - _one_if(ahead)
    moved = jnp.where(downstream, slots + jnp.sum(ahead, dtype=jnp.int32) - before, target + before)
    return jnp.where(between, moved, slots)


def reordered(genome: Genome, place: Int[Array, " nodes"], origin: Int[Array, " nodes"]) -> Genome:
    """Move the node in each slot to its new place; `origin` is where the node of each place was."""
    genes = genome.connections
    return replace(
        genome,
        nodes=jax.tree.map(lambda leaf: leaf[origin], genome.nodes),
        connections=replace(
            genes,
            source=jnp.where(genome.has_connection, place[genes.source], 0),
            target=jnp.where(genome.has_connection, place[genes.target], 0),
        ),
    )


def delete_connection(happens: Bool[Array, ""], u: Float[Array, ""], genome: Genome) -> Genome:
    """Delete the connection that `u` in [0, 1) picks; the last one takes its place."""
    genes = genome.connections
    places = jnp.arange(genes.weight.shape[0])
    chosen = places == _pick(u, genome.connection_count)
    last = genome.connection_count - 1

    def move(leaf: Array) -> Array:
        moved = jnp.sum(jnp.where(places == last, leaf, 0))
        return jnp.where(places == last, jnp.zeros((), leaf.dtype), jnp.where(chosen, moved, leaf))

    cut = replace(genome, connections=jax.tree.map(move, genes), connection_count=genome.connection_count - 1)
    return select(happens & (genome.connection_count > 0), cut, genome)


def _one_if(condition: Bool[Array, "*shape"]) -> Int[Array, "*shape"]:
    return condition.astype(jnp.int32)


def _pick(u: Float[Array, ""], count: Int[Array, ""]) -> Int[Array, ""]:
    """Return one of 0 … count - 1 for a uniform `u` in [0, 1); 0 when count is 0.

    A count is a few hundred at most, against the 2²³ steps of u.
    """
    return jnp.floor(u * jnp.maximum(count, 1).astype(jnp.float32)).astype(jnp.int32)


def draw(key: PRNGKeyArray, attribute: Attribute, size: int) -> Float[Array, " size"]:
    """Draw new values of an attribute."""
    values = attribute.mean + attribute.std * jax.random.normal(key, (size,))
    return jnp.clip(values, -attribute.bound, attribute.bound)


def mutate(
    attribute: Attribute, values: Float[Array, "*genes"], u: Float[Array, "*genes"], z: Float[Array, "*genes"]
) -> Float[Array, "*genes"]:
    """Mutate each value: u < rate adds N(0, power²), u < rate + replace draws a new value; then clip.

    `u` and `z` are uniform and normal numbers; noise and a new draw exclude each other, so both can use one z.
    """
    changed = jnp.where(u < attribute.mutate_rate, values + attribute.power * z, values)
    new = (u >= attribute.mutate_rate) & (u < attribute.mutate_rate + attribute.replace_rate)
    changed = jnp.where(new, attribute.mean + attribute.std * z, changed)
    return jnp.clip(changed, -attribute.bound, attribute.bound)


def mutate_values(key: PRNGKeyArray, settings: Mutation, activations: int, genome: Genome) -> Genome:
    """Mutate every gene's numbers, including those of inputs and outputs.

    A gene's draws do not depend on the number of other genes, so capacity does not change the result. `activations` is
    how many functions a node may choose from.
    """
    nodes, genes = genome.nodes, genome.connections
    node_choice, node_noise, choice, noise, function = streams(
        key, "node_choice", "node_noise", "connection_choice", "connection_noise", "function"
    )
    attributes = (nodes.bias.shape[0], 2)
    u, z = jax.random.uniform(node_choice, attributes), jax.random.normal(node_noise, attributes)
    bias = mutate(settings.bias, nodes.bias, u[:, 0], z[:, 0])
    response = mutate(settings.response, nodes.response, u[:, 1], z[:, 1])
    activation = nodes.activation
    if activations > 1:
        draws = jax.random.uniform(function, attributes)
        drawn = jnp.floor(draws[:, 1] * activations).astype(jnp.int32)
        activation = jnp.where((draws[:, 0] < settings.activation_replace) & genome.has_node, drawn, activation)
    places = genes.weight.shape
    weight = mutate(settings.weight, genes.weight, jax.random.uniform(choice, places), jax.random.normal(noise, places))
    return replace(
        genome,
        nodes=Nodes(
            key=nodes.key,
            bias=jnp.where(genome.has_node, bias, 0),
            response=jnp.where(genome.has_node, response, 0),
            activation=activation,
        ),
        connections=replace(genes, weight=jnp.where(genome.has_connection, weight, 0)),
    )
