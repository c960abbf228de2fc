"""A function as a kernel: what it computes, and how a batch of it is called on processors and GPUs.

XLA splits a robot's time step into some hundred kernels. Here the whole step is computed in registers.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from functools import cache, cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import jaxpr_as_fun
from jaxtyping import Array

from evoclaims.kernels.call import calls
from evoclaims.kernels.emit import block_kernel, gpu_kernel, host_kernel, llvm_ir, machine_code, part_kernel
from evoclaims.kernels.emit.llvm_ir import ArrayRow
from evoclaims.kernels.emit.parts import WORTHWHILE, Parts, Place
from evoclaims.kernels.trace.expressions import Input, Unsupported, everything
from evoclaims.kernels.trace.interpreter import Numbers
from evoclaims.kernels.trace.scalarize import scalarize

Shapes = tuple[jax.ShapeDtypeStruct, ...]
Parting = Callable[..., Sequence[Sequence[Place]]]
"""Gets arguments with `Place`s for numbers; returns those that belong to each part, in the same order."""


class Kernel:
    """A function of arrays of given shapes.

    Attributes:
        name: what it computes, for the warning and for profilers.
        shapes: its arguments' leaves, without batch dimensions.
        outputs: its results' leaves.
        structure: its results' tree.
    """

    def __init__(
        self, function: Callable[..., Any], name: str, treedef: Any, shapes: Shapes, parts: Parting | None = None
    ) -> None:
        """Trace the function once; for `parts` see `one_kernel`."""
        self.name = name
        self.shapes = shapes
        self._traced, shape = jax.make_jaxpr(function, return_shape=True)(*jax.tree.unflatten(treedef, shapes))
        self.outputs: Shapes = tuple(jax.ShapeDtypeStruct(x.shape, x.dtype) for x in jax.tree.leaves(shape))
        self.structure = jax.tree.structure(shape)
        self._parts = [] if parts is None else parts(*jax.tree.unflatten(treedef, _places(shapes)))
        self._gpu_programs: dict[tuple[int, tuple[int, ...]], gpu_kernel.GpuProgram] = {}

    @cached_property
    def supported(self) -> bool:
        """Whether it can be a kernel; a warning says once why not."""
        try:
            machine_code.lanes()
            llvm_ir.check([number for result in self.results for number in result.flat])
        except Unsupported as reason:
            warnings.warn(f"{self.name} is not one kernel, and slower, because of {reason}.", stacklevel=5)
            return False
        return True

    @cached_property
    def results(self) -> list[Numbers]:
        """The expressions of the numbers of each result."""
        return scalarize(self._traced)

    @cached_property
    def _packed(self) -> tuple[Parts, list[Numbers]] | None:
        """The operations that are alike in all parts, and the results, if there are enough of them."""
        if not self._parts:
            return None
        made = scalarize(self._traced, mirrors=True)
        results = [made[i] for i in self.written]
        parts = Parts([n for r in results for n in r.flat], self._parts)
        return (parts, results) if parts.share() <= WORTHWHILE else None

    @cached_property
    def written(self) -> list[int]:
        """The results that are not empty."""
        return [place for place, result in enumerate(self.results) if result.size]

    @cached_property
    def read(self) -> dict[int, ArrayRow]:
        """The rows of the arguments that the results depend on."""
        used = {e.array for e in everything(n for r in self.results for n in r.flat) if isinstance(e, Input)}
        return {i: ArrayRow(math.prod(self.shapes[i].shape), self.shapes[i].dtype.kind) for i in sorted(used)}

    @cached_property
    def _host_text(self) -> str:
        """LLVM's text of the kernel for this machine's processor, which is the same for every batch."""
        text = host_kernel.text([self.results[i] for i in self.written], self.read, machine_code.lanes())
        vars(self).pop("results", None)  # a kernel lives as long as the process; a GPU's text makes them again
        return text

    def as_it_is(self, *leaves: Array) -> list[Array]:
        """Call the function itself, for every element of a batch."""
        depths = self.depths(leaves)
        repeated: Any = jaxpr_as_fun(self._traced)
        for level in reversed(range(max(depths))):
            repeated = jax.vmap(repeated, [0 if depth > level else None for depth in depths])
        made: list[Array] = repeated(*leaves)
        return made

    def depths(self, leaves: Sequence[Any]) -> list[int]:
        """Return how many batch dimensions each argument has; one with fewer than others lacks the innermost."""
        return [len(leaf.shape) - len(shape.shape) for leaf, shape in zip(leaves, self.shapes, strict=True)]

    def batch(self, leaves: Sequence[Any]) -> tuple[int, ...]:
        """Return the batch dimensions."""
        depths = self.depths(leaves)
        deepest = max(range(len(leaves)), key=depths.__getitem__)
        shape: tuple[int, ...] = leaves[deepest].shape[: depths[deepest]]
        return shape

    def in_front(self, leaves: Sequence[Array], axes: Sequence[int | None]) -> list[Array]:
        """Add a batch dimension in front of the others; arguments that are the same in the whole batch stay so."""
        size = next(leaf.shape[axis] for leaf, axis in zip(leaves, axes, strict=True) if axis is not None)

        def moved(leaf: Array, axis: int | None, alone: jax.ShapeDtypeStruct) -> Array:
            if axis is not None:
                return jnp.moveaxis(leaf, axis, 0)
            return leaf if leaf.ndim == len(alone.shape) else jnp.broadcast_to(leaf, (size, *leaf.shape))

        return list(map(moved, leaves, axes, self.shapes))

    def on_host(self, *leaves: Array) -> list[Array]:
        """Call the kernel for this machine's processor, for every element of a batch."""

        def call(rows: int, shared: list[int], shapes: Shapes) -> Any:
            layout = [rows, *(shared[i] for i in self.read)]
            return calls.on_host(self._host_text, layout, [leaves[i] for i in self.read], shapes)

        return self._call(leaves, call)

    def on_gpu(self, *leaves: Array) -> list[Array]:
        """Call the kernel for NVIDIA's GPUs, for every element of a batch."""

        def call(rows: int, shared: list[int], shapes: Shapes) -> Any:
            program = self._gpu_program(rows, tuple(shared[i] for i in self.read))
            return calls.on_gpu(program, [leaves[i] for i in self.read], shapes, rows)

        return self._call(leaves, call)

    def _gpu_program(self, rows: int, shared: tuple[int, ...]) -> gpu_kernel.GpuProgram:
        """Return the kernel for NVIDIA's GPUs: for how many elements, how many of which share a row of each array."""
        if (rows, shared) not in self._gpu_programs:  # a legged robot's takes seconds
            self._gpu_programs[rows, shared] = self._written_for_gpus(rows, dict(zip(self.read, shared, strict=True)))
        return self._gpu_programs[rows, shared]

    def _written_for_gpus(self, rows: int, shared: dict[int, int]) -> gpu_kernel.GpuProgram:
        """Write it in the way that is fastest; see `_gpu_program`."""
        if self._packed:
            parts, alike = self._packed
            text = part_kernel.text(parts, alike, self.read, shared, rows)
            return gpu_kernel.program(text, self.name, gpu_kernel.BLOCK // parts.count)
        results = [self.results[i] for i in self.written]
        shape = block_kernel.chosen(results, rows)
        if shape is None:
            return gpu_kernel.program(gpu_kernel.text(results, self.read, shared, rows), self.name)
        text = block_kernel.text(shape, results, self.read, shared, rows)
        elements = gpu_kernel.BLOCK * shape.teams
        return gpu_kernel.program(text, self.name, elements, shape.warps, shape.teams, shape.shared_bytes)

    def _call(self, leaves: Sequence[Array], call: Callable[..., Any]) -> list[Array]:
        """Return the results of a kernel for every element of a batch.

        Args:
            leaves: the arguments.
            call: gets the number of elements, how many of them share a row of each argument, and the shapes of the
                results that are not empty, each [elements, numbers]; returns these results.
        """
        depths, batch = self.depths(leaves), self.batch(leaves)
        rows = math.prod(batch)
        results = [jnp.zeros((*batch, *out.shape), out.dtype) for out in self.outputs]
        if not rows or not self.written:
            return results
        shared = [math.prod(batch[depth:]) for depth in depths]
        wanted = [self.outputs[i] for i in self.written]
        shapes = [jax.ShapeDtypeStruct((rows, math.prod(out.shape)), out.dtype) for out in wanted]
        for place, made in zip(self.written, call(rows, shared, shapes), strict=True):
            results[place] = made.reshape(results[place].shape)
        return results


def _places(shapes: Shapes) -> list[Any]:
    """Return arrays with the `Place` of each number."""
    arrays = [np.empty(math.prod(shape.shape), object) for shape in shapes]
    for at, array in enumerate(arrays):
        for place in range(array.size):
            array[place] = (at, place)
    return [array.reshape(shape.shape) for array, shape in zip(arrays, shapes, strict=True)]


def one_kernel(function: Callable[..., Any], name: str, parts: Parting | None = None) -> Callable[..., Any]:
    """Return `function`, run as one kernel on processors and NVIDIA's GPUs.

    It may be batched, any number of times; derivatives are those of the function itself. If it cannot be one kernel
    (`Unsupported`), it runs unchanged, and a warning says why.

    Args:
        function: takes trees of small arrays (float32, int32, bool); pure.
        name: what it computes, for the warning and for profilers.
        parts: which numbers of the arguments belong to parts that are alike: 2, 4, 8, 16 or 32. On a GPU each then has
            a thread of its own, if enough is alike.
    """

    @cache
    def kernel(treedef: Any, shapes: Shapes) -> Kernel:
        return Kernel(function, name, treedef, shapes, parts)

    def run(*arguments: Any) -> Any:
        leaves, treedef = jax.tree.flatten(arguments)
        leaves = [jnp.asarray(leaf) for leaf in leaves]
        made = kernel(treedef, tuple(jax.ShapeDtypeStruct(leaf.shape, leaf.dtype) for leaf in leaves))
        if not leaves or not made.supported:
            return function(*arguments)
        return jax.tree.unflatten(made.structure, calls.CALL.bind(*leaves, kernel=made))

    return run
