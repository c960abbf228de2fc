"""How different two genomes are (Stanley and Miikkulainen 2002, Eq. (1), in TensorNEAT's form)."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from evoclaims.methods.neat.homology import counterparts
from evoclaims.methods.neat.settings import Species
from evoclaims.networks.genome import Genome


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
