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


def switch_together(index: Int[Array, ""], branches: Sequence[Callable[..., Any]], *operands: Any) -> Any:
    """Run `branches[index]` on the operands; a whole batch runs the branch of its largest index.

    An ordinary switch under vmap runs every branch. Here all branches must compute the same and differ only in
    capacity, smallest first. The only traced values they may close over are floating-point.
    """
    # A function with its own batching rule sees only its arguments as batched.
    converted = [jax.closure_convert(branch, *operands) for branch in branches]
    closed = [partial(_apply, convert, place) for place, (convert, _) in enumerate(converted)]
    return _switch(index, closed, [values for _, values in converted], *operands)


def _apply(function: Callable[..., Any], place: int, closed_over: Sequence[Any], *operands: Any) -> Any:
    return function(*operands, *closed_over[place])


def _switch(index: Int[Array, ""], branches: Sequence[Callable[..., Any]], *operands: Any) -> Any:
    """Run `branches[index]` with a batching rule; the branches close over no traced values."""

    @custom_vmap
    def choose(index: Array, *operands: Any) -> Any:
        return jax.lax.switch(index, branches, *operands)

    @choose.def_vmap
    def together(size: int, batched: Any, index: Array, *operands: Any) -> tuple[Any, Any]:
        axes = tuple(jax.tree.map(lambda leaf: 0 if leaf else None, batched[1:]))
        batches = [jax.vmap(branch, in_axes=axes, axis_size=size) for branch in branches]
        result = _switch(jnp.max(index), batches, *operands)
        return result, jax.tree.map(lambda _: True, result)

    return choose(index, *operands)


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


def in_capacity(
    sizes: Sequence[tuple[int, int]], genomes: tuple[Genome, ...], function: Callable[..., Any], *operands: Any
) -> Any:
    """Call `function(nodes, connections, *operands)` with the smallest of the `sizes` that fits the genomes' children.

    A child may have one node and two connections more than its parent, up to the largest of the sizes. The result must
    not depend on the capacity.
    """
    most = sizes[-1]
    nodes = jnp.minimum(jnp.stack([jnp.max(each.node_count) for each in genomes]).max() + 1, most[0])
    connections = jnp.minimum(jnp.stack([jnp.max(each.connection_count) for each in genomes]).max() + 2, most[1])
    too_small = [(nodes > n) | (connections > c) for n, c in sizes[:-1]]
    index: Int[Array, ""] = jnp.sum(jnp.array(too_small, bool), dtype=jnp.int32)
    return switch_together(index, [partial(function, *size) for size in sizes], *operands)
