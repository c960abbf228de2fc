"""Calls of kernels in XLA's programs, by a primitive of jax: its rules for platforms, batches and derivatives."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any, Final, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import ShapedArray
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jaxtyping import Array

from evoclaims.kernels.emit import gpu_kernel, machine_code
from evoclaims.kernels.emit.gpu_kernel import GpuProgram
from evoclaims.kernels.emit.host_kernel import ENTRY

GPU_TARGET: Final = "__gpu$xla.gpu.ptx"
"""XLA's name for a kernel given as PTX."""
Shapes = Sequence[jax.ShapeDtypeStruct]


class Callee(Protocol):
    """A kernel; each method that calls it computes every element of a batch."""

    @property
    def outputs(self) -> Shapes:
        """Shapes of the results of one element."""

    def batch(self, leaves: Sequence[Any]) -> tuple[int, ...]:
        """Return the batch dimensions of arguments."""

    def in_front(self, leaves: Sequence[Array], axes: Sequence[int | None]) -> list[Array]:
        """Add a batch dimension, which each argument has at its axis, in front of the others; copy one without it."""
        size = next(leaf.shape[axis] for leaf, axis in zip(leaves, axes, strict=True) if axis is not None)
        return [
            jnp.broadcast_to(leaf, (size, *leaf.shape)) if axis is None else jnp.moveaxis(leaf, axis, 0)
            for leaf, axis in zip(leaves, axes, strict=True)
        ]

    def as_it_is(self, *leaves: Array) -> list[Array]:
        """Call the function itself."""

    def on_host(self, *leaves: Array) -> list[Array]:
        """Call the kernel for this machine's processor."""

    def on_gpu(self, *leaves: Array) -> list[Array]:
        """Call the kernel for NVIDIA's GPUs, or what is faster there: the function itself."""
        return self.as_it_is(*leaves)


def on_host(text: str, layout: Sequence[int], operands: Sequence[Array], shapes: Shapes) -> Any:
    """Call a kernel of this processor, given as LLVM's text; `layout` are numbers for its `work`."""
    return jax.ffi.ffi_call(_host_target(text), shapes)(np.array(layout, np.int32), *operands)


def on_gpu(program: GpuProgram, operands: Sequence[Array], shapes: Shapes, elements: int) -> Any:
    """Call a kernel of NVIDIA's GPUs.

    Args:
        program: the kernel.
        operands: the arrays it reads.
        shapes: of its results.
        elements: of the batch.
    """
    one = np.int32(1)
    return jax.ffi.ffi_call(GPU_TARGET, shapes)(
        *operands,
        name=program.name,
        kernel_type="ptx",
        kernel_data=program.ptx,
        grid_x=np.int32(-(-elements // program.elements)),
        grid_y=one,
        grid_z=one,
        block_x=np.int32(gpu_kernel.BLOCK),
        block_y=np.int32(program.warps),
        block_z=np.int32(program.teams),
        shared_mem_bytes=np.int32(program.shared_bytes),
    )


@cache
def _host_target(text: str) -> str:
    """Return the name under which XLA knows the kernel of a text; compile it first."""
    name = f"evoclaims_{machine_code.key_of(text)}"
    handler = ctypes.CFUNCTYPE(ctypes.c_void_p)(machine_code.address(text, ENTRY))
    jax.ffi.register_ffi_target(name, jax.ffi.pycapsule(handler), platform="cpu")
    return name


CALL: Final = Primitive("kernel")
"""A kernel's call: the arguments' batch dimensions are in front of its own; its parameter `kernel` is a `Callee`."""
CALL.multiple_results = True


def _alone(*leaves: Array, kernel: Callee) -> list[Array]:
    """Run outside of compiled programs."""
    made: list[Array] = jax.jit(partial(CALL.bind, kernel=kernel))(*leaves)
    return made


def _shapes(*leaves: ShapedArray, kernel: Callee) -> list[ShapedArray]:
    return [ShapedArray((*kernel.batch(leaves), *out.shape), out.dtype) for out in kernel.outputs]


def _batched(leaves: Sequence[Array], axes: Sequence[int | None], kernel: Callee) -> tuple[list[Array], list[int]]:
    results = CALL.bind(*kernel.in_front(leaves, axes), kernel=kernel)
    return results, [0] * len(results)


def _derivative(values: Sequence[Any], tangents: Sequence[Any], kernel: Callee) -> Any:
    return jax.jvp(kernel.as_it_is, tuple(values), tuple(map(ad.instantiate_zeros, tangents)))


def _lowered(choose: Callable[[Callee], Callable[..., list[Array]]]) -> Any:
    """Return a lowering rule: a method of the kernel."""

    def rule(context: Any, *operands: Any, kernel: Callee) -> Any:
        return mlir.lower_fun(choose(kernel), multiple_results=True)(context, *operands)

    return rule


def gpu_is_new_enough() -> bool:
    """Whether the GPU runs kernels. A program may be lowered without one."""
    capability = getattr(jax.devices()[0], "compute_capability", None)
    return capability is None or float(capability) >= gpu_kernel.CAPABILITY


def _for_gpu(kernel: Callee) -> Callable[..., list[Array]]:
    """Return the kernel's call; GPUs that are too old get the function itself."""
    return kernel.on_gpu if gpu_is_new_enough() else kernel.as_it_is


CALL.def_impl(_alone)
CALL.def_abstract_eval(_shapes)
batching.primitive_batchers[CALL] = _batched
ad.primitive_jvps[CALL] = _derivative
mlir.register_lowering(CALL, _lowered(lambda kernel: kernel.as_it_is))
mlir.register_lowering(CALL, _lowered(lambda kernel: kernel.on_host), platform="cpu")
mlir.register_lowering(CALL, _lowered(_for_gpu), platform="cuda")
