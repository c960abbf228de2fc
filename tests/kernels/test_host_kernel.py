"""What LLVM makes of a processor's kernel."""

from __future__ import annotations

import platform

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.kernels import one_kernel
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


def test_floats_beyond_the_largest_integer_become_it() -> None:
    most = 2**31 - 1
    wanted = {
        0.0: 0,
        -1.9: -1,
        1.9: 1,
        np.nan: 0,
        np.inf: most,
        -np.inf: -most - 1,
        2.0**31: most,
        -(2.0**31): -most - 1,
    }
    wanted |= {3e9: most, -3e9: -most - 1, 2147483520.0: 2147483520, -2147483520.0: -2147483520}
    floats = np.array(list(wanted), np.float32)
    made = jax.vmap(one_kernel(lambda x: x.astype(jnp.int32), "This"))(floats)
    np.testing.assert_array_equal(made, list(wanted.values()))
