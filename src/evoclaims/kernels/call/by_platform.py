"""A function that NVIDIA's GPUs compute in another way than processors do, by a primitive of jax.

`jax.lax.platform_dependent` would do, but traces both ways on every platform, with each level of batches: a second or
more for a function of a thousand operations, which a processor never runs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import jax
import jax.numpy as jnp
from jax.core import ShapedArray
from jax.extend.core import Primitive, jaxpr_as_fun
from jax.interpreters import ad, batching, mlir
from jaxtyping import Array

Leaves = Callable[..., Sequence[Array]]
"""A function from leaves of arguments to leaves of results."""
Shapes = tuple[jax.ShapeDtypeStruct, ...]


def by_platform(function: Callable[..., Any], on_gpu: Callable[..., Any]) -> Callable[..., Any]:
    """Return `function`, which programs for NVIDIA's GPUs compute by `on_gpu`.

    It may be batched, any number of times. Derivatives, and results outside of compiled programs, are those of
    `function`, and so are programs for other platforms. `on_gpu` is traced only when a program is lowered for a GPU.

    Args:
        function: takes trees of arrays; pure. Neither way may use traced values that are not its arguments.
        on_gpu: the same up to rounding, with results of the same tree, shapes and dtypes.
    """

    def run(*arguments: Any) -> Any:
        leaves, treedef = jax.tree.flatten(arguments)
        traced, shape = jax.make_jaxpr(function, return_shape=True)(*arguments)

        def flat(*leaves: Array) -> Sequence[Array]:
            return jax.tree.leaves(on_gpu(*jax.tree.unflatten(treedef, leaves)))

        outputs = tuple(jax.ShapeDtypeStruct(out.shape, out.dtype) for out in jax.tree.leaves(shape))
        made = BY_PLATFORM.bind(*map(jnp.asarray, leaves), function=jaxpr_as_fun(traced), on_gpu=flat, outputs=outputs)
        return jax.tree.unflatten(jax.tree.structure(shape), made)

    return run


BY_PLATFORM: Final = Primitive("by_platform")
"""Its parameters are `function` and `on_gpu`, of leaves, and the shapes of their `outputs`."""
BY_PLATFORM.multiple_results = True


def _alone(*leaves: Array, function: Leaves, on_gpu: Leaves, outputs: Shapes) -> Sequence[Array]:
    return function(*leaves)


def _shapes(*leaves: ShapedArray, function: Leaves, on_gpu: Leaves, outputs: Shapes) -> list[ShapedArray]:
    return [ShapedArray(out.shape, out.dtype) for out in outputs]


def _batched(
    leaves: Sequence[Array], axes: Sequence[int | None], function: Leaves, on_gpu: Leaves, outputs: Shapes
) -> tuple[list[Array], list[int]]:
    size = next(leaf.shape[axis] for leaf, axis in zip(leaves, axes, strict=True) if axis is not None)
    results = BY_PLATFORM.bind(
        *leaves,
        function=jax.vmap(function, axes),
        on_gpu=jax.vmap(on_gpu, axes),
        outputs=tuple(jax.ShapeDtypeStruct((size, *out.shape), out.dtype) for out in outputs),
    )
    return results, [0] * len(results)


def _derivative(values: Sequence[Any], tangents: Sequence[Any], function: Leaves, **_: Any) -> Any:
    return jax.jvp(function, tuple(values), tuple(map(ad.instantiate_zeros, tangents)))


def _lowered(name: str) -> Any:
    """Return a lowering rule: what a parameter holds."""

    def rule(context: Any, *operands: Any, **parameters: Any) -> Any:
        return mlir.lower_fun(parameters[name], multiple_results=True)(context, *operands)

    return rule


BY_PLATFORM.def_impl(_alone)
BY_PLATFORM.def_abstract_eval(_shapes)
batching.primitive_batchers[BY_PLATFORM] = _batched
ad.primitive_jvps[BY_PLATFORM] = _derivative
mlir.register_lowering(BY_PLATFORM, _lowered("function"))
mlir.register_lowering(BY_PLATFORM, _lowered("on_gpu"), platform="cuda")
