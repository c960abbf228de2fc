"""Running a function as one kernel over a batch: a lane of a processor's vectors, or a GPU's thread, per element.

XLA splits a robot's time step into some hundred kernels. Here the whole step is computed in registers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any, Final

import jax
import jax.numpy as jnp
from jax.core import ShapedArray
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jaxtyping import Array

from evoclaims.kernels import gpu_kernel
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


@CALL.def_impl
def _alone(*leaves: Array, kernel: Kernel) -> list[Array]:
    """Run outside of compiled programs."""
    made: list[Array] = jax.jit(partial(CALL.bind, kernel=kernel))(*leaves)
    return made


def _batched(leaves: Sequence[Array], axes: Sequence[int | None], kernel: Kernel) -> tuple[list[Array], list[int]]:
    """Add a batch dimension in front of the others; arguments that are the same in the whole batch stay as they are."""
    size = next(leaf.shape[axis] for leaf, axis in zip(leaves, axes, strict=True) if axis is not None)

    def in_front(leaf: Array, axis: int | None, alone: jax.ShapeDtypeStruct) -> Array:
        if axis is not None:
            return jnp.moveaxis(leaf, axis, 0)
        return leaf if leaf.ndim == len(alone.shape) else jnp.broadcast_to(leaf, (size, *leaf.shape))

    results = CALL.bind(*map(in_front, leaves, axes, kernel.shapes), kernel=kernel)
    return results, [0] * len(results)


def _derivative(values: Sequence[Any], tangents: Sequence[Any], kernel: Kernel) -> Any:
    """Return the results and their derivatives, both of the function itself."""
    return jax.jvp(kernel.as_it_is, tuple(values), tuple(map(ad.instantiate_zeros, tangents)))


def _lowered_for_gpu(context: Any, *operands: Any, kernel: Kernel) -> Any:
    """Lower for NVIDIA's GPUs; those that are too old get the function itself."""
    call = kernel.on_gpu if _is_new_enough() else kernel.as_it_is
    return mlir.lower_fun(call, multiple_results=True)(context, *operands)


def _is_new_enough() -> bool:
    """Whether this machine's GPU runs kernels; a program may be lowered without one."""
    capability = getattr(jax.devices()[0], "compute_capability", None)
    return capability is None or float(capability) >= gpu_kernel.CAPABILITY


def _lowered(call: Callable[..., list[Array]]) -> Any:
    """Return a lowering rule: a method of the kernel."""

    def rule(context: Any, *operands: Any, kernel: Kernel) -> Any:
        return mlir.lower_fun(partial(call, kernel), multiple_results=True)(context, *operands)

    return rule


batching.primitive_batchers[CALL] = _batched
ad.primitive_jvps[CALL] = _derivative
mlir.register_lowering(CALL, _lowered(Kernel.as_it_is))
mlir.register_lowering(CALL, _lowered(Kernel.on_host), platform="cpu")
mlir.register_lowering(CALL, _lowered_for_gpu, platform="cuda")
