"""Jaxprs that NumPy evaluates: the results of jax's compiled programs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from kernel_functions import FUNCTIONS

from evoclaims.kernels import in_numpy

X = np.random.default_rng(0).normal(size=(5, 4))
MORE: dict[str, Callable[[Any], Any]] = {
    "angles": lambda x: (jnp.arccos(jnp.tanh(x)), jnp.arcsin(jnp.tanh(x)), jnp.arctan(x), jnp.tan(x)),
    "bounds": lambda x: (jax.lax.clamp(-0.3, x, jnp.abs(x[0])), jnp.sign(x), jnp.isfinite(1 / (x - x[0])), x % 0.3),
    "powers": lambda x: (jax.lax.rsqrt(x * x), jnp.power(jnp.abs(x), x), jnp.exp(x), jnp.log(x * x), jnp.square(x)),
    "rows": lambda x: (jnp.tile(x, 2), jax.lax.pad(x, 0.5, [(1, 2, 1)]), jax.lax.cumsum(x, reverse=True)),
    "integer quotients": lambda x: (jnp.int32(x * 9) // 4, jax.lax.div(jnp.int32(x * 9), jnp.int32(x * 3))),
    "a loop over rows": lambda x: jax.lax.scan(lambda c, row: (c + row, c * row), x[0], x[1:], reverse=True),
    "a loop of unknown length": lambda x: jax.lax.while_loop(lambda c: c < 9.0, lambda c: c + jnp.abs(x[0]) + 1, x[1]),
    "a window at a place of its own": lambda x: jax.lax.dynamic_slice(x, (jnp.argmax(x),), (2,)),
    "writing at places of their own": lambda x: (x.at[jnp.argsort(x)].add(x), x.at[jnp.argmax(x) + 2].set(7.0)),
    "reading beyond the end": lambda x: (x.at[jnp.argmax(x) + 2].get(mode="fill"), x[jnp.argmax(x) + 2]),
    "reading integers beyond the end": lambda x: jnp.arange(4).at[jnp.argmax(x) + 2].get(mode="fill"),
    "nothing": lambda x: (x[:0].sum(), x[:0].max(initial=1.0), jnp.zeros(3)),
}


@pytest.mark.parametrize(("function", "inputs"), FUNCTIONS.values(), ids=FUNCTIONS)
def test_numpy_computes_what_xla_computes(function: Callable[..., Any], inputs: tuple[Any, ...]) -> None:
    _require_equal(function, *(x[:5] for x in inputs))


@pytest.mark.parametrize("function", MORE.values(), ids=MORE)
def test_numpy_computes_what_kernels_do_not(function: Callable[[Any], Any]) -> None:
    with jax.enable_x64(True):
        _require_equal(function, X)


def _require_equal(function: Callable[..., Any], *inputs: Any) -> None:
    expected = jax.tree.leaves(
        jax.jit(jax.vmap(function), compiler_options={"xla_backend_optimization_level": 0})(*inputs)
    )
    results = in_numpy(function, *inputs)
    exact = 1e-13 if inputs[0].dtype == np.float64 else 2e-5
    for one, other in zip(results, expected, strict=True):
        assert (one.shape, one.dtype) == (other.shape, other.dtype)
        np.testing.assert_allclose(one, other, rtol=exact, atol=exact)
