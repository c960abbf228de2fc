"""Mutation of the numbers in genes (TensorNEAT): noise, a new draw, or nothing."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from evoclaims.core.keys import streams
from evoclaims.methods.neat.settings import Attribute, Mutation
from evoclaims.networks.genome import Genome, Nodes


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
