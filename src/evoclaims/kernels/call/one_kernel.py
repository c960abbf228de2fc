"""Running a function as one kernel over a batch: a lane of a processor's vectors, or a GPU's thread, per element.

XLA splits a robot's time step into some hundred kernels. Here the whole step is computed in registers.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp

from evoclaims.kernels.call import calls
from evoclaims.kernels.call.kernel import Kernel, Shapes


def one_kernel(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """Return `function`, run as one kernel on processors and NVIDIA's GPUs.

    It may be batched, any number of times; derivatives are those of the function itself. If it cannot be one kernel
    (`Unsupported`), it runs unchanged, and a warning says why.

    Args:
        function: takes trees of small arrays (float32, int32, bool); pure.
        name: what it computes, for the warning and for profilers.
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
        return jax.tree.unflatten(made.structure, calls.CALL.bind(*leaves, kernel=made))

    return run
