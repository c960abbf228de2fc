"""Crossover (Stanley and Miikkulainen 2002, §3.2)."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from evoclaims.core.keys import streams
from evoclaims.methods.neat.homology import counterparts_in_pairs
from evoclaims.networks.genome import Genome, Nodes


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
