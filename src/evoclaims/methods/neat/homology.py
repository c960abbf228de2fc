"""Which genes of two genomes are homologous (Stanley and Miikkulainen 2002, §3.2), found without sorting."""

from __future__ import annotations

from functools import cache, partial

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from evoclaims.core.pytree import pytree
from evoclaims.kernels.grouped import GroupKernel
from evoclaims.kernels.one_kernel import one_kernel
from evoclaims.methods.neat.homology_kernel import write_search
from evoclaims.networks.genome import Connections, Genome, Nodes


@pytree
class Counterparts:
    """For each gene of one genome, the homologous gene of another.

    Attributes:
        nodes: the other's node genes; arbitrary where there is no counterpart.
        has_node: whether a node has a counterpart.
        weight: the weight of the other's connection; NaN where there is none.
    """

    nodes: Nodes
    has_node: Bool[Array, " nodes"]
    weight: Float[Array, " connections"]

    @property
    def has_connection(self) -> Bool[Array, " connections"]:
        """Whether a connection has a counterpart."""
        return ~jnp.isnan(self.weight)


def counterparts(genome: Genome, other: Genome) -> Counterparts:
    """Find the counterparts of `genome`'s genes in `other`."""
    search = _search(genome.nodes.key.shape[-1], genome.connections.weight.shape[-1])
    genes = genome.connections
    own = genome.nodes.key, genes.source, genes.target, genome.node_count, genome.connection_count
    slot, bias, response, activation, weight = search(*jax.tree.leaves(other), *own)
    nodes = Nodes(key=genome.nodes.key, bias=bias, response=response, activation=activation)
    return Counterparts(nodes=nodes, has_node=slot >= 0, weight=weight)


@cache
def _search(nodes: int, connections: int) -> GroupKernel:
    """Return the kernel that finds counterparts in genomes of a capacity; genomes with the same other are a group."""
    (slots, places, one), (of_nodes, of_connections) = (
        [jax.ShapeDtypeStruct(shape, dtype) for shape in shapes]
        for shapes, dtype in ((((nodes,), (connections,), ()), jnp.int32), (((nodes,), (connections,)), jnp.float32))
    )
    return GroupKernel(
        name="The breeding of genomes",
        function=_searched,
        groups=(slots, of_nodes, of_nodes, slots, places, places, of_connections, one, one),
        rows=(slots, places, places, one, one),
        outputs=(slots, of_nodes, of_nodes, slots, of_connections),
        write=partial(write_search, (nodes, connections)),
        one_lane=True,
        for_gpus=False,
    )


def _searched(*leaves: Array) -> list[Array]:
    """Return the other's slot of each node or -1, its bias, response and activation, and each connection's weight."""
    other = Genome(Nodes(*leaves[:4]), Connections(*leaves[4:7]), *leaves[7:9])
    key, source, target, node_count, connection_count = leaves[9:]
    size = key.shape[0]
    has_node, has_connection = jnp.arange(size) < node_count, jnp.arange(source.shape[0]) < connection_count
    found: Int[Array, " nodes"] = jax.vmap(_slot, (0, None))(key, other.nodes.key)
    slot = jnp.where(has_node, found, -1)
    there = has_connection & (slot[source] >= 0) & (slot[target] >= 0)
    weight = jnp.where(there, _matrix(other)[slot[target], slot[source]], jnp.nan)
    return [slot, *(leaf[slot] for leaf in leaves[1:4]), weight]


def _place(key: Int[Array, ""], keys: Int[Array, " nodes"]) -> Int[Array, ""]:
    """Return where a key is among others; -1 if it is not."""
    return jnp.max(jnp.where(keys == key, jnp.arange(keys.shape[0], dtype=jnp.int32), -1))


_slot = one_kernel(_place, "The search for homologous nodes")


def _matrix(genome: Genome) -> Float[Array, "nodes nodes"]:
    """Return weights[i, j] of the connection from slot j to slot i; NaN where there is none."""
    size, genes = genome.nodes.key.shape[0], genome.connections
    target = jnp.where(genome.has_connection, genes.target, size)
    return jnp.full((size, size), jnp.nan).at[target, genes.source].set(genes.weight, mode="drop")
