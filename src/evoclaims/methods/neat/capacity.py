"""Programs for small genomes: arrays sized for the current genomes, not for the largest possible ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

import jax
import jax.numpy as jnp
from jax.custom_batching import custom_vmap
from jaxtyping import Array, Int

from evoclaims.methods.neat.settings import Settings
from evoclaims.networks.genome import Genome

SMALLER: Final = ((32, 96), (100, 200))
"""Capacities (nodes, connections) to compile for, besides the largest; each costs compile time.

The first is six times as fast as the paper's 100 nodes and 400 connections. The second is for grown networks, which
have far fewer connections than they may have."""


def capacities(settings: Settings, inputs: int, outputs: int) -> list[tuple[int, int]]:
    """Return the capacities (nodes, connections) that generations are compiled for, the largest last.

    In each of them, the first networks, which connect all inputs with all outputs, have room to grow.
    """
    most = settings.nodes, settings.connections
    least = inputs + outputs + 1, inputs * outputs + 2
    smaller = (size for size in SMALLER if size[0] <= most[0] and size[1] < most[1])
    return [*(size for size in smaller if least[0] <= size[0] and least[1] <= size[1]), most]


def fitting(sizes: Sequence[tuple[int, int]], genomes: Sequence[Genome]) -> Int[Array, ""]:
    """Return the place of the smallest of the `sizes` that fits the genomes' children.

    A child may have one node and two connections more than its parent, up to the largest of the sizes.
    """
    most = sizes[-1]
    nodes = jnp.minimum(jnp.stack([jnp.max(each.node_count) for each in genomes]).max() + 1, most[0])
    connections = jnp.minimum(jnp.stack([jnp.max(each.connection_count) for each in genomes]).max() + 2, most[1])
    too_small = [(nodes > n) | (connections > c) for n, c in sizes[:-1]]
    return jnp.sum(jnp.array(too_small, bool), dtype=jnp.int32)


def in_capacity(
    sizes: Sequence[tuple[int, int]], genomes: Sequence[Genome], function: Callable[..., Any], *operands: Any
) -> Any:
    """Call `function(nodes, connections, *operands)` with the smallest of the `sizes` that fits the genomes' children.

    The result must not depend on the capacity. Under `vmap`, all work in the smallest that fits all.
    """
    place = _largest(fitting(sizes, genomes))
    return jax.lax.switch(place, [partial(function, *size) for size in sizes], *operands)


@custom_vmap
def _largest(place: Int[Array, ""]) -> Int[Array, ""]:
    """Return a place; under `vmap` the largest: if all sizes were computed, kernels would write behind small arrays."""
    return place


@_largest.def_vmap
def _(size: int, batched: Sequence[bool], places: Int[Array, " trials"]) -> tuple[Int[Array, ""], bool]:
    return _largest(jnp.max(places)), False
