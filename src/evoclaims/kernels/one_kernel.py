"""Running a function as one GPU kernel, with one thread per element of a batch.

XLA splits a robot's time step into some hundred kernels, and each costs at least a microsecond however few robots
there are. Here one thread computes a robot's whole step in registers.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Final

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_batching import custom_vmap
from jaxtyping import Array

from evoclaims.kernels import ptx
from evoclaims.kernels.interpreter import Numbers
from evoclaims.kernels.scalarize import scalarize
from evoclaims.kernels.unsupported import Unsupported

BLOCK: Final = 32
"""Threads in a block: one warp, so that even few robots use many processors."""
TARGET: Final = "__gpu$xla.gpu.ptx"
"""XLA's call target for a kernel given as PTX."""
Shapes = tuple[jax.ShapeDtypeStruct, ...]


def one_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return `function`, run as one kernel on an NVIDIA GPU, and unchanged elsewhere.

    It may be batched, any number of times (under `jax.shard_map` with `check_vma=False`). If it cannot be one kernel
    (`Unsupported`), it runs unchanged, and a warning says why.

    Args:
        function: takes trees of small arrays (float32, int32, bool); pure, and not differentiated.
    """

    @cache
    def program(treedef: Any, shapes: Shapes) -> tuple[list[Numbers], Any] | None:
        """Return the results' expressions and shapes."""
        try:
            results, shape = scalarize(function, *jax.tree.unflatten(treedef, shapes))
            ptx.check_results(results)
        except Unsupported as reason:
            warnings.warn(f"What could be one GPU kernel is many, and slower, because of {reason}.", stacklevel=3)
            return None
        return results, shape

    def run(*arguments: Any) -> Any:
        leaves, treedef = jax.tree.flatten(arguments)
        if not leaves or not has_gpu():
            return function(*arguments)
        leaves = [jnp.asarray(leaf) for leaf in leaves]
        shapes = tuple(jax.ShapeDtypeStruct(leaf.shape, leaf.dtype) for leaf in leaves)
        made = program(treedef, shapes)
        if made is None:
            return function(*arguments)
        results, shape = made

        def alone(*leaves: Array) -> list[Array]:
            return jax.tree.leaves(function(*jax.tree.unflatten(treedef, leaves)))

        outputs = tuple(jax.ShapeDtypeStruct(x.shape, x.dtype) for x in jax.tree.leaves(shape))
        return jax.tree.unflatten(jax.tree.structure(shape), _batched(alone, results, shapes, outputs)(*leaves))

    return run


@cache
def has_gpu() -> bool:
    """Whether programs may run on an NVIDIA GPU that is new enough."""
    device = jax.devices()[0]
    try:
        return device.platform == "gpu" and float(device.compute_capability) >= ptx.CAPABILITY
    except (AttributeError, ValueError):  # not NVIDIA's
        return False


def _batched(alone: Callable[..., list[Array]], results: list[Numbers], shapes: Shapes, outputs: Shapes) -> Any:
    """Return a function of the leaves, each with any number of leading batch dimensions.

    An array with fewer of them lacks the innermost.
    """

    @custom_vmap
    def call(*leaves: Array) -> list[Array]:
        depths = [leaf.ndim - len(shape.shape) for leaf, shape in zip(leaves, shapes, strict=True)]
        deepest = max(range(len(leaves)), key=depths.__getitem__)
        batch = leaves[deepest].shape[: depths[deepest]]

        def as_one_kernel(*leaves: Array) -> list[Array]:
            return _launch(results, leaves, depths, batch, shapes, outputs)

        def as_it_is(*leaves: Array) -> list[Array]:
            repeated = alone
            for level in reversed(range(len(batch))):
                repeated = jax.vmap(repeated, [0 if depth > level else None for depth in depths])
            return repeated(*leaves)

        made: list[Array] = jax.lax.platform_dependent(*leaves, cuda=as_one_kernel, default=as_it_is)
        return made

    @call.def_vmap
    def batch(size: int, batched: Sequence[bool], *leaves: Array) -> tuple[list[Array], list[bool]]:
        whole = [
            leaf if of_batch or leaf.ndim == len(shape.shape) else jnp.broadcast_to(leaf, (size, *leaf.shape))
            for leaf, shape, of_batch in zip(leaves, shapes, batched, strict=True)
        ]
        results = call(*whole)
        return results, [True] * len(results)

    return call


def _launch(
    results: list[Numbers],
    leaves: Sequence[Array],
    depths: Sequence[int],
    batch: tuple[int, ...],
    shapes: Shapes,
    outputs: Shapes,
) -> list[Array]:
    """Call the kernel with one thread per element of the batch."""
    threads = math.prod(batch)
    some = [i for i, result in enumerate(results) if result.size and threads]
    if not some:
        return [jnp.zeros((*batch, *out.shape), out.dtype) for out in outputs]
    written = [results[i] for i in some]
    arrays = {
        i: ptx.Array(math.prod(shapes[i].shape), np.dtype(shapes[i].dtype), math.prod(batch[depths[i] :]))
        for i in ptx.arrays_read(written)
    }
    call = jax.ffi.ffi_call(TARGET, [jax.ShapeDtypeStruct((threads, results[i].size), outputs[i].dtype) for i in some])
    one, none = np.int32(1), np.int32(0)
    rows = call(
        *(leaves[i] for i in arrays),
        name=ptx.ENTRY,
        kernel_type="ptx",
        kernel_data=ptx.kernel(written, arrays, threads, BLOCK),
        grid_x=np.int32(-(-threads // BLOCK)),
        grid_y=one,
        grid_z=one,
        block_x=np.int32(BLOCK),
        block_y=one,
        block_z=one,
        shared_mem_bytes=none,
    )
    made = dict(zip(some, rows, strict=True))
    return [
        made[i].reshape(*batch, *out.shape) if i in made else jnp.zeros((*batch, *out.shape), out.dtype)
        for i, out in enumerate(outputs)
    ]
