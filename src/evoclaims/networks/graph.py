"""The network that a genome describes, and its forward pass.

Node i computes z = bias + response · Σ w x over its connections (TensorNEAT, Wang et al. 2024). A hidden node emits
its activation function of z. An output emits z to other nodes, and its result is the output function of z. A node
without a connection from an emitting node emits nothing, nor does an input that is not finite; the result of an
output that emits nothing is 0. A value that overflows is passed on as 0, and so is the sine of an angle beyond 50,000,
which the kernel (`kernels/genomes/network.py`) does not compute.

Machines without the kernel compute the pass by matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from evoclaims.core.pytree import pytree
from evoclaims.kernels import GroupKernel
from evoclaims.kernels.genomes.network import network_kernel, sorting_kernel
from evoclaims.networks.activations import ACTIVATIONS, apply_activation, check_activations
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


@pytree
class Graph:
    """A network in matrix form, its nodes in topological order.

    Attributes:
        weights: weights[i, j] of the connection from j to i; 0 without one.
        linked: whether there is a connection from j to i; strictly lower triangular.
        bias, response: of each node.
        activation: of each node, index into the network's activation functions; identity for outputs.
        outputs: the slots of the outputs.
    """

    weights: Float[Array, "nodes nodes"]
    linked: Bool[Array, "nodes nodes"]
    bias: Float[Array, " nodes"]
    response: Float[Array, " nodes"]
    activation: Int[Array, " nodes"]
    outputs: Int[Array, " outputs"]


@dataclass(frozen=True)
class GraphNetwork:
    """Networks of genomes, with fixed numbers of inputs and outputs.

    Attributes:
        activations: names of the functions that node genes index.
        output: name of the outputs' function.
    """

    inputs: int
    outputs: int
    activations: tuple[str, ...] = ("tanh",)
    output: str = "tanh"

    def __post_init__(self) -> None:
        """Check the names."""
        check_activations((*self.activations, self.output))

    def express(self, genome: Genome) -> Wiring | Graph:
        """Return a genome's network: a list of connections where there is a kernel for it, else matrices."""
        wiring = wired(genome, self.inputs, self.outputs, len(self.activations))
        return wiring if self._kernel_for(wiring).supported else self.matrices(wiring)

    def apply(self, network: Wiring | Graph, observation: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
        """Map one observation to one output; a vmap over only observations runs them through one kernel together."""
        if isinstance(network, Graph):
            return self.propagate(network, observation)
        (result,) = self._kernel_for(network)(*jax.tree.leaves(network), observation)
        return result

    def _kernel_for(self, wiring: Wiring) -> GroupKernel:
        return _kernel(self, (wiring.bias.shape[-1], wiring.weight.shape[-1]))

    def matrices(self, wiring: Wiring) -> Graph:
        """Return a network in matrix form."""
        nodes, connections = wiring.bias.shape[0], wiring.weight.shape[0]
        # The connection at a place leads to the first slot whose connections end behind it. Places behind all of them
        # write outside the matrix, where writes are dropped.
        places = jnp.arange(connections, dtype=jnp.int32)
        target = jnp.sum(wiring.ends[:, None] <= places[None, :], axis=0, dtype=jnp.int32)
        return Graph(
            weights=jnp.zeros((nodes, nodes)).at[target, wiring.source].set(wiring.weight, mode="drop"),
            linked=jnp.zeros((nodes, nodes), bool).at[target, wiring.source].set(True, mode="drop"),
            bias=wiring.bias,
            response=wiring.response,
            activation=wiring.activation,
            outputs=wiring.outputs,
        )

    def propagate(self, graph: Graph, observation: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
        """Map one observation by matrices, node after node; slots are in topological order, so one pass is enough."""
        present = jnp.isfinite(observation)
        rest = (0, graph.bias.shape[0] - self.inputs)

        def fire(slot: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
            values, emits = state
            fed = jnp.any(graph.linked[slot] & emits)
            z = graph.bias[slot] + graph.response[slot] * jnp.sum(graph.weights[slot] * values)
            value = apply_activation((*self.activations, "identity"), graph.activation[slot], z)
            return values.at[slot].set(jnp.where(fed & jnp.isfinite(value), value, 0.0)), emits.at[slot].set(fed)

        given = jnp.pad(jnp.where(present, observation, 0.0), rest), jnp.pad(present, rest)
        values, emits = jax.lax.fori_loop(self.inputs, graph.bias.shape[0], fire, given)
        readings = ACTIVATIONS[self.output](values[graph.outputs])
        return jnp.where(emits[graph.outputs], readings, 0.0)


@cache
def _kernel(network: GraphNetwork, capacity: tuple[int, int]) -> GroupKernel:
    """Return the kernel of the forward pass; platforms without it compute the pass by matrices."""

    def function(*leaves: Array) -> list[Array]:
        *genome, observation = leaves
        return [network.propagate(network.matrices(Wiring(*genome)), observation)]

    nodes = [ACTIVATIONS[name] for name in (*network.activations, "identity")]
    return network_kernel(network.inputs, network.outputs, nodes, ACTIVATIONS[network.output], capacity, function)
