"""A genome's network as a list of connections in the order in which they are used: its phenotype."""

from __future__ import annotations

from functools import cache

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from evoclaims.core.pytree import pytree
from evoclaims.kernels import GroupKernel
from evoclaims.kernels.genomes.sorting import sorting_kernel
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
    return sorting_kernel(nodes, connections, lambda *genes: _sorted(nodes, *genes))


def _sorted(nodes: int, source: Array, target: Array, weight: Array, count: Array) -> list[Array]:
    """Sort by target; equals keep their order."""
    there = jnp.arange(weight.shape[0], dtype=jnp.int32) < count
    target = jnp.where(there, target, nodes)
    order = jnp.argsort(target)
    ends = jnp.sum(target[None, :] <= jnp.arange(nodes, dtype=jnp.int32)[:, None], axis=1, dtype=jnp.int32)
    return [jnp.where(there, source[order], 0), jnp.where(there, weight[order], 0.0), ends]
