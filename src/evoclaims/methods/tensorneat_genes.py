"""TensorNEAT's genome format, and translation of our genomes to it, to compare the two implementations."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from evoclaims.core.pytree import pytree
from evoclaims.networks.genome import Genome


@pytree
class Genes:
    """One of TensorNEAT's genomes; NaN where there is no gene.

    Attributes:
        nodes: rows (key, bias, response, aggregation, activation): inputs, outputs, then hidden nodes in any order.
        connections: rows (source key, target key, weight).
    """

    nodes: Float[Array, "nodes 5"]
    connections: Float[Array, "connections 3"]


def present(genes: Genes) -> list[NDArray[np.float32]]:
    """Return the rows of nodes and of connections that hold a gene, on the host."""
    tables = np.asarray(genes.nodes), np.asarray(genes.connections)
    return [table[~np.isnan(table).all(axis=1)] for table in tables]


def translated(genome: Genome) -> Genes:
    """Translate one of our genomes to TensorNEAT's format, where keys from 2²⁴ on are not exact."""
    nodes, genes = genome.nodes, genome.connections
    absent = np.iinfo(np.int32).max
    # Sorting by key puts inputs first, then outputs, then hidden nodes.
    order = jnp.argsort(jnp.where(genome.has_node, nodes.key, absent), stable=True)
    columns = (nodes.key, nodes.bias, nodes.response, jnp.zeros_like(nodes.bias), nodes.activation)
    rows = jnp.stack([column.astype(jnp.float32) for column in columns], axis=1)
    links = (nodes.key[genes.source], nodes.key[genes.target], genes.weight)
    linked = jnp.stack([column.astype(jnp.float32) for column in links], axis=1)
    return Genes(
        nodes=jnp.where(genome.has_node[:, None], rows, jnp.nan)[order],
        connections=jnp.where(genome.has_connection[:, None], linked, jnp.nan),
    )
