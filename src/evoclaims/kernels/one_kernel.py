"""Running a function as one kernel over a batch: a lane of a processor's vectors, or a GPU's thread, per element.

XLA splits a robot's time step into some hundred kernels. Here the whole step is computed in registers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Final

import jax
import jax.numpy as jnp
from jax.core import ShapedArray
from jax.extend.core import Primitive
from jax.interpreters import batching
from jaxtyping import Array

from evoclaims.kernels import calls
from evoclaims.kernels.kernel import Kernel, Shapes


def one_kernel(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """Return `function`, run as one kernel on processors and NVIDIA's GPUs.

    It may be batched, any number of times; derivatives are those of the function itself. If it cannot be one kernel
    (`Unsupported`), it runs unchanged, and a warning says why.

    Args:
        function: takes trees of small arrays (float32, int32, bool); pure.
        name: what it computes, for the warning.
    """

    @cache
    def kernel(treedef: Any, shapes: Shapes) -> Kernel:
        return Kernel(function, name, treedef, shapes)

    def run(*arguments: Any) -> Any:
        leaves, treedef = jax.tree.flatten(arguments)
        leaves = [jnp.asarray(leaf) for leaf in leaves]
        made = kernel(treedef, tuple(jax.ShapeDtypeStruct(leaf.shape, leaf.dtype) for leaf in leaves))
        if not leaves or not made.supported:
            return function(*arguments)
        return jax.tree.unflatten(made.structure, CALL.bind(*leaves, kernel=made))

    return run


CALL: Final = Primitive("one_kernel")
"""A kernel's call: the arguments' batch dimensions are in front of the kernel's own."""
CALL.multiple_results = True


@CALL.def_abstract_eval
def _shapes(*leaves: ShapedArray, kernel: Kernel) -> list[ShapedArray]:
    """Return the results' shapes."""
    return [ShapedArray((*kernel.batch(leaves), *out.shape), out.dtype) for out in kernel.outputs]


def _batched(leaves: Sequence[Array], axes: Sequence[int | None], kernel: Kernel) -> tuple[list[Array], list[int]]:
    """Add a batch dimension in front of the others; arguments that are the same in the whole batch stay as they are."""
    size = next(leaf.shape[axis] for leaf, axis in zip(leaves, axes, strict=True) if axis is not None)

    def in_front(leaf: Array, axis: int | None, alone: jax.ShapeDtypeStruct) -> Array:
        if axis is not None:
            return jnp.moveaxis(leaf, axis, 0)
        return leaf if leaf.ndim == len(alone.shape) else jnp.broadcast_to(leaf, (size, *leaf.shape))

    results = CALL.bind(*map(in_front, leaves, axes, kernel.shapes), kernel=kernel)
    return results, [0] * len(results)


batching.primitive_batchers[CALL] = _batched
calls.register(CALL)
