"""A genome's network as a list of connections in the order in which they are used: its phenotype."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from evoclaims.core.pytree import pytree
from evoclaims.kernels.control import repeat
from evoclaims.kernels.group_kernel import Rows
from evoclaims.kernels.grouped import GroupKernel
from evoclaims.kernels.words import load, store
from evoclaims.networks.genome import Genome


@pytree
class Wiring:
    """A network whose connections are sorted by the node they lead to; nodes are in topological order.

    Attributes:
        source: the slot each connection comes from.
        weight: of each connection.
        ends: of each slot, the number of connections that lead to it or to a lower one.
        bias, response: of each node.
        activation: of each node, index into the network's activation functions; one beyond the last for outputs.
        outputs: the slots of the outputs.
        count: the number of nodes.
    """

    source: Int[Array, " connections"]
    weight: Float[Array, " connections"]
    ends: Int[Array, " nodes"]
    bias: Float[Array, " nodes"]
    response: Float[Array, " nodes"]
    activation: Int[Array, " nodes"]
    outputs: Int[Array, " outputs"]
    count: Int[Array, ""]


def wired(genome: Genome, inputs: int, outputs: int, functions: int) -> Wiring:
    """Return a genome's network; `functions` is the number of activation functions."""
    genes = genome.connections
    kernel = _sorting(genome.nodes.key.shape[-1], genes.weight.shape[-1])
    source, weight, ends = kernel(genes.source, genes.target, genes.weight, genome.connection_count)
    slots = genome.slots_of_outputs(inputs, outputs)
    return Wiring(
        source=source,
        weight=weight,
        ends=ends,
        bias=genome.nodes.bias,
        response=genome.nodes.response,
        activation=jnp.asarray(genome.nodes.activation).at[slots].set(functions),
        outputs=slots,
        count=genome.node_count,
    )


@cache
def _sorting(nodes: int, connections: int) -> GroupKernel:
    """Return the kernel that sorts a genome's connections, given capacities."""
    numbers, whole = jax.ShapeDtypeStruct((connections,), jnp.float32), jax.ShapeDtypeStruct((connections,), jnp.int32)
    ends, one = jax.ShapeDtypeStruct((nodes,), jnp.int32), jax.ShapeDtypeStruct((), jnp.int32)

    def write(lanes: Rows, groups: Sequence[str], rows: Sequence[str], results: Sequence[str]) -> None:
        _write(lanes, nodes, connections, groups, results)

    return GroupKernel(
        name="The forward pass of genomes",
        function=lambda *genes: _sorted(nodes, *genes),
        groups=(whole, whole, numbers, one),
        rows=(),
        outputs=(whole, numbers, ends),
        write=write,
    )


def _sorted(nodes: int, source: Array, target: Array, weight: Array, count: Array) -> list[Array]:
    """Sort by target; equals keep their order."""
    there = jnp.arange(weight.shape[0], dtype=jnp.int32) < count
    target = jnp.where(there, target, nodes)
    order = jnp.argsort(target)
    ends = jnp.sum(target[None, :] <= jnp.arange(nodes, dtype=jnp.int32)[:, None], axis=1, dtype=jnp.int32)
    return [jnp.where(there, source[order], 0), jnp.where(there, weight[order], 0.0), ends]


def _write(lanes: Rows, nodes: int, connections: int, groups: Sequence[str], results: Sequence[str]) -> None:
    """Write the same as a counting sort; `ends` is first the number of each slot's connections, then where they are."""
    page = lanes.page
    source, target, weight, count_at = groups
    sorted_source, sorted_weight, ends = results
    places = page.allocate("i32", nodes, 4)
    count = page.put(f"load i32, ptr {count_at}, align 4")

    def clear(slot: str) -> list[str]:
        store(page, "0", places, slot)
        return []

    def tally(connection: str) -> list[str]:
        slot = load(page, target, connection)
        store(page, page.put(f"add i32 {load(page, places, slot)}, 1"), places, slot)
        return []

    def add_up(slot: str, before: str) -> list[str]:
        after = page.put(f"add i32 {before}, {load(page, places, slot)}")
        store(page, before, places, slot)
        store(page, after, ends, slot)
        return [after]

    def move(connection: str) -> list[str]:
        slot = load(page, target, connection)
        place = load(page, places, slot)
        store(page, page.put(f"add i32 {place}, 1"), places, slot)
        store(page, load(page, source, connection), sorted_source, place)
        store(page, load(page, weight, connection), sorted_weight, place)  # as bits
        return []

    def empty(place: str) -> list[str]:
        store(page, "0", sorted_source, place)
        store(page, "0", sorted_weight, place)
        return []

    repeat(page, "0", str(nodes), [], clear)
    repeat(page, "0", count, [], tally)
    repeat(page, "0", str(nodes), [("i32", "0")], add_up)
    repeat(page, "0", count, [], move)
    repeat(page, count, str(connections), [], empty)
