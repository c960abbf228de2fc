"""A switch that runs only one branch even when batched by `jax.vmap`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_batching import custom_vmap
from jaxtyping import Array, Int


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
    """Call the branch at `place`."""
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
