"""Running a kernel over groups of rows; `group_kernel` has the kernels' texts."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from evoclaims.kernels.call import calls
from evoclaims.kernels.emit import gpu_kernel, group_kernel, machine_code
from evoclaims.kernels.emit.group_kernel import Sizes, Writer
from evoclaims.kernels.trace.expressions import Unsupported

Shapes = tuple[jax.ShapeDtypeStruct, ...]


@dataclass(frozen=True, eq=False)
class GroupKernel:
    """A function of some arrays of a group and some of a row, of float32 and int32.

    Attributes:
        name: what it is part of, for profilers and the warning that it cannot be had; kernels of one name warn once.
        function: it in jax: takes all arrays, and returns a list.
        groups, rows: shapes of the group's arguments, and the row's.
        outputs: shapes of the results, none of them empty.
        write: writes it in LLVM's instructions.
        one_lane: whether `write` goes through all rows of a group itself, one after the other, rather than computing a
            vector of them.
        for_gpus: whether it is faster than `function` on GPUs too.
    """

    name: str
    function: Callable[..., Sequence[Array]]
    groups: Shapes
    rows: Shapes
    outputs: Shapes
    write: Writer
    one_lane: bool = False
    for_gpus: bool = True

    def __call__(self, *leaves: Array) -> list[Array]:
        """Compute it, for any batch. With only the rows batched, or the groups, these are not copied."""
        if not self.supported:
            return list(self.function(*leaves))
        made: list[Array] = calls.CALL.bind(*leaves, kernel=self)
        return made

    @cached_property
    def supported(self) -> bool:
        """Whether it can be a kernel on this machine."""
        try:
            machine_code.lanes()
        except Unsupported as reason:
            _warn_once(f"{self.name} is not one kernel, and slower, because of {reason}.")
            return False
        return True

    @property
    def sizes(self) -> Sizes:
        """The numbers in each array."""
        groups, rows, results = (
            tuple(math.prod(each.shape) for each in shapes) for shapes in (self.groups, self.rows, self.outputs)
        )
        return Sizes(groups, rows, results)

    def batch(self, leaves: Sequence[Any]) -> tuple[int, ...]:
        """Return the batch dimensions; arguments that lack one have size 1 there."""
        shapes = (*self.groups, *self.rows)
        parts = [leaf.shape[: leaf.ndim - len(own.shape)] for leaf, own in zip(leaves, shapes, strict=True)]
        return tuple(1 if set(sizes) == {1} else next(s for s in sizes if s != 1) for sizes in zip(*parts, strict=True))

    def in_front(self, leaves: Sequence[Array], axes: Sequence[int | None]) -> list[Array]:
        """Add a batch dimension in front of the others, of size 1 where it is the same in the whole batch."""
        pairs = zip(leaves, axes, strict=True)
        return [leaf[None] if axis is None else jnp.moveaxis(leaf, axis, 0) for leaf, axis in pairs]

    def as_it_is(self, *leaves: Array) -> list[Array]:
        """Call the function itself, for every element of a batch."""
        batch = self.batch(leaves)
        if not batch:
            return list(self.function(*leaves))
        has = [leaf.shape[0] == batch[0] for leaf in leaves]
        given = [leaf if own else leaf[0] for leaf, own in zip(leaves, has, strict=True)]
        made: list[Array] = jax.vmap(self.as_it_is, [0 if own else None for own in has], axis_size=batch[0])(*given)
        return made

    def on_host(self, *leaves: Array) -> list[Array]:
        """Call the kernel for this machine's processor, for every element of a batch."""

        def call(groups: int, rows: int, own: list[bool], operands: list[Array], shapes: Shapes) -> Any:
            lanes = 1 if self.one_lane else group_kernel.lanes_for(rows, machine_code.lanes())
            together = group_kernel.ALL if self.one_lane else lanes
            text = group_kernel.host_text(self.write, self.sizes, lanes, together)
            return calls.on_host(text, [groups, rows, *own], operands, shapes)

        return self._call(leaves, call)

    def on_gpu(self, *leaves: Array) -> list[Array]:
        """Call the kernel for NVIDIA's GPUs, or the function if that is faster there, for every element of a batch."""
        if not self.for_gpus:
            return self.as_it_is(*leaves)

        def call(groups: int, rows: int, own: list[bool], operands: list[Array], shapes: Shapes) -> Any:
            text = group_kernel.gpu_text(self.write, self.sizes, groups, rows, own)
            return calls.on_gpu(gpu_kernel.program(text, self.name), operands, shapes, groups * rows)

        return self._call(leaves, call)

    def _call(self, leaves: Sequence[Array], call: Callable[..., Any]) -> list[Array]:
        """Return the results of a kernel for every element of a batch.

        Args:
            leaves: the arguments.
            call: gets the numbers of groups and of rows of each, which arrays of rows each group has its own of, the
                arrays, and the shapes of the results, [groups, rows, numbers]; returns these results.
        """
        batch = self.batch(leaves)
        if not math.prod(batch):
            return [jnp.zeros((*batch, *out.shape), out.dtype) for out in self.outputs]
        of_groups, of_rows = leaves[: len(self.groups)], leaves[len(self.groups) :]
        level = range(len(batch))
        inner = [i for i in level if batch[i] > 1 and all(leaf.shape[i] == 1 for leaf in of_groups)]
        outer = [i for i in level if i not in inner]
        groups, rows = (math.prod(batch[i] for i in levels) for levels in (outer, inner))

        def sorted_(leaf: Array, repeated: Sequence[int]) -> Array:
            """Move a leaf's dimensions of groups to the front, and give it full size in those of `repeated`."""
            moved = jnp.transpose(leaf, (*outer, *inner, *range(len(batch), leaf.ndim)))
            sizes = [batch[i] if i in repeated else leaf.shape[i] for i in (*outer, *inner)]
            return jnp.broadcast_to(moved, (*sizes, *leaf.shape[len(batch) :]))

        sizes = self.sizes
        operands = [
            sorted_(leaf, outer).reshape(groups, size) for leaf, size in zip(of_groups, sizes.groups, strict=True)
        ]
        own = [any(leaf.shape[i] > 1 for i in outer) for leaf in of_rows]
        for leaf, size, has_own in zip(of_rows, sizes.rows, own, strict=True):
            full = sorted_(leaf, level if has_own else inner)
            operands.append(full.reshape(groups * rows if has_own else rows, size))
        shapes = [
            jax.ShapeDtypeStruct((groups * rows, size), out.dtype)
            for out, size in zip(self.outputs, sizes.results, strict=True)
        ]
        made = call(groups, rows, own, operands, shapes)
        order = (*outer, *inner)
        back = [order.index(i) for i in level]
        results = []
        for out, result in zip(self.outputs, made, strict=True):
            shaped = result.reshape(*(batch[i] for i in order), *out.shape)
            results.append(jnp.transpose(shaped, (*back, *range(len(batch), shaped.ndim))))
        return results


def gpus_run_kernels() -> bool:
    """Whether the GPU of this machine runs kernels, not their functions."""
    try:
        machine_code.lanes()
    except Unsupported:
        return False
    return calls.gpu_is_new_enough()


@cache
def _warn_once(text: str) -> None:
    """Warn, whatever the filters of warnings say, at most once in a process."""
    warnings.warn(text, stacklevel=6)
