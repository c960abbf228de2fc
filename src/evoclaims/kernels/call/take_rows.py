"""Rows of several arrays at the same places, copied by one kernel on processors: XLA makes a kernel for each array."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int

from evoclaims.kernels.call import calls
from evoclaims.kernels.emit import machine_code
from evoclaims.kernels.emit.control import load, repeat
from evoclaims.kernels.emit.host_kernel import handler
from evoclaims.kernels.emit.llvm_ir import Instructions
from evoclaims.kernels.trace.expressions import Unsupported

T = TypeVar("T")
COPIED: Final = frozenset("biuf")
"""Kinds of numbers, as NumPy names them, that the kernel copies; others, such as random keys, are indexed."""


def take_rows(tree: T, places: Int[Array, "*shape"]) -> T:
    """Return `leaf[places]` of every array of a tree.

    Args:
        tree: arrays with the same number of rows, [rows, …].
        places: int32 from 0 to below the number of rows. Others count as the first or the last row on processors.
    """
    leaves, structure = jax.tree.flatten(tree)
    places = jnp.asarray(places, jnp.int32)
    copied = [leaf for leaf in leaves if _is_copied(leaf)]
    shapes = tuple(jax.ShapeDtypeStruct(leaf.shape, leaf.dtype) for leaf in copied)
    taken = iter(calls.CALL.bind(places, *copied, kernel=_Taking(places.shape, shapes)) if copied else ())
    rows = [next(taken) if _is_copied(leaf) else leaf[places] for leaf in leaves]
    made: T = jax.tree.unflatten(structure, rows)
    return made


def _is_copied(leaf: Array) -> bool:
    """Whether a kernel copies rows of an array: where there are kernels."""
    try:
        machine_code.lanes()
    except Unsupported:
        return False
    return getattr(leaf.dtype, "kind", None) in COPIED


@dataclass(frozen=True)
class _Taking(calls.Callee):
    """The kernel; its text is the same for all sizes.

    Attributes:
        places: the shape of the places.
        arrays: the shapes of the arrays.
    """

    places: tuple[int, ...]
    arrays: tuple[jax.ShapeDtypeStruct, ...]

    @property
    def outputs(self) -> calls.Shapes:
        """Shapes of the rows taken."""
        return [jax.ShapeDtypeStruct((*self.places, *each.shape[1:]), each.dtype) for each in self.arrays]

    def batch(self, leaves: Sequence[Any]) -> tuple[int, ...]:
        """Return the batch dimensions."""
        shape: tuple[int, ...] = leaves[0].shape
        return shape[: len(shape) - len(self.places)]

    def as_it_is(self, *leaves: Array) -> list[Array]:
        """Index the arrays, for every element of a batch."""
        if self.batch(leaves):
            made: list[Array] = jax.vmap(self.as_it_is)(*leaves)
            return made
        places, *arrays = leaves
        return [array[places] for array in arrays]

    def on_host(self, *leaves: Array) -> list[Array]:
        """Call the kernel for this machine's processor; not for batches, which no program for processors has."""
        shapes, count = self.outputs, math.prod(self.places)
        if self.batch(leaves) or not all(math.prod(each.shape) for each in shapes):
            return self.as_it_is(*leaves)
        places, *arrays = leaves
        numbers = [math.prod(each.shape[1:]) for each in self.arrays]
        sizes = [size * each.dtype.itemsize for size, each in zip(numbers, self.arrays, strict=True)]
        layout = [count, self.arrays[0].shape[0], *sizes]
        flat = [jax.ShapeDtypeStruct((count, size), each.dtype) for size, each in zip(numbers, shapes, strict=True)]
        operands = [places.reshape(-1), *arrays]
        made = calls.on_host(_text(len(arrays)), layout, operands, flat)
        return [rows.reshape(each.shape) for rows, each in zip(made, shapes, strict=True)]


@cache
def _text(arrays: int) -> str:
    """Return the text of the kernel for so many arrays."""
    page = Instructions(1)
    page.label("entry")
    count = page.put("trunc i64 %count to i32")
    last = page.put(f"sub i32 {page.put('trunc i64 %rows to i32')}, 1")

    def copy(number: str) -> list[str]:
        place = load(page, "%a0", number)
        for name, limit in (("smax", "0"), ("smin", last)):
            place = page.call(f"llvm.{name}.i32", "i32", [("i32", place), ("i32", limit)])
        from_, to = (page.put(f"zext i32 {row} to i64") for row in (place, number))
        for array in range(arrays):
            size = f"%size{array}"
            source, target = (
                page.put(f"getelementptr i8, ptr {address}, i64 {page.put(f'mul i64 {wide}, {size}')}")
                for address, wide in ((f"%a{array + 1}", from_), (f"%z{array}", to))
            )
            operands = [("ptr", target), ("ptr", source), ("i64", size), ("i1", "false")]
            page.call("llvm.memcpy.p0.p0.i64", "void", operands)
        return []

    repeat(page, "0", count, [], copy)
    page.write("ret void")
    given = ["i64 %count", "i64 %rows", *(f"i64 %size{array}" for array in range(arrays))]
    given += [f"ptr %a{array}" for array in range(arrays + 1)] + [f"ptr %z{array}" for array in range(arrays)]
    body = "\n".join(page.lines)
    work = f"define internal void @work({', '.join(given)}) nounwind {{\n{body}\n}}\n"
    return "\n".join(page.declared) + "\n" + work + handler(2 + arrays, 1 + arrays, arrays)
