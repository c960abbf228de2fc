"""What LLVM makes of a processor's kernel."""

from __future__ import annotations

import platform

import jax
import jax.numpy as jnp
import pytest

from evoclaims.kernels.call.kernel import Kernel
from evoclaims.kernels.emit import machine_code


def _crowded(x: jax.Array) -> jax.Array:
    """Need far more numbers at a time than there are registers."""
    many = jnp.sqrt(jnp.outer(x, x + 1.0))
    return jnp.sum(many / jnp.sum(many))


X86 = platform.machine() in ("x86_64", "AMD64")


@pytest.mark.skipif(not X86, reason="other processors' instructions have one size")
def test_spilled_registers_have_a_short_address() -> None:
    shape = jax.ShapeDtypeStruct((8,), jnp.float32)
    kernel = Kernel(_crowded, "This", jax.tree.structure((shape,)), (shape,))
    made = machine_code.llvm.parse_assembly(kernel._host_text)
    moves = [line for line in machine_code._target().emit_assembly(made).splitlines() if "mm" in line]
    assert sum("(%rbx)" in line for line in moves) > 100
    assert not any("(%rsp)" in line for line in moves)
