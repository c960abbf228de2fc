"""Exponentials, logarithms and what is made of them are as exact as they say, at every magnitude."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray

from evoclaims.kernels.call.kernel import one_kernel
from evoclaims.kernels.trace.algebra import Algebra
from evoclaims.kernels.trace.elementary import ELEMENTARY

SMALLEST: Final = float(np.finfo(np.float32).tiny)
ENDS: Final = np.array([0, 1, -1, 2, -2, 0.5, -0.5, 3, -3, np.inf, -np.inf, np.nan, 1e38, 0.3, 2**24, 1e9], np.float32)

LOGISTIC: Final = np.vectorize(lambda x: 0.0 if x < -700 else 1 / (1 + math.exp(-x)))
ONE_OPERAND: Final[dict[str, tuple[Callable[..., Any], Callable[..., Any], float]]] = {
    "exp": (jnp.exp, np.exp, 2),
    "expm1": (jnp.expm1, np.expm1, 4),
    "log": (jnp.log, np.log, 2),
    "log1p": (jnp.log1p, np.log1p, 2),
    "logistic": (jax.nn.sigmoid, LOGISTIC, 4),
    "tanh": (jnp.tanh, np.tanh, 6),
}
"""In jax, in NumPy, and the largest error in units of the last place."""


def _everywhere() -> NDArray[np.float32]:
    """Return numbers of all magnitudes and signs, and many of those near 0."""
    magnitudes = np.arange(0, 2**31, 40_009, dtype=np.int64).astype(np.int32).view(np.float32)
    near = np.linspace(-100, 100, 40_001, dtype=np.float32), np.linspace(-1, 1, 40_001, dtype=np.float32)
    return np.concatenate([magnitudes, -magnitudes, *near, ENDS])


def _check(made: Any, wanted: Any, most: float) -> None:
    """Compare float32 with float64; what is tiny may be 0."""
    rounded = wanted.astype(np.float32)
    ordinary = np.isfinite(rounded)
    np.testing.assert_array_equal(made[~ordinary], rounded[~ordinary])
    made, wanted, rounded = made[ordinary], wanted[ordinary], rounded[ordinary]
    error = np.abs(made - wanted)
    large = np.abs(wanted) >= SMALLEST
    assert (error[~large] <= SMALLEST).all()
    assert (error[large] / np.spacing(np.abs(rounded[large])).astype(np.float64)).max() <= most


@pytest.mark.parametrize("name", ONE_OPERAND)
def test_a_function_of_one_number_is_wrong_by_few_units_of_the_last_place(name: str) -> None:
    function, exact, most = ONE_OPERAND[name]
    x = _everywhere()
    x = x[~(np.abs(x) < SMALLEST) | (x == 0)]  # processors may take the others for 0
    made = np.asarray(jax.jit(jax.vmap(one_kernel(function, "This")))(x))
    with np.errstate(all="ignore"):
        _check(made, np.asarray(exact(x.astype(np.float64))), most)


def test_any_power_is_wrong_by_few_units_of_the_last_place() -> None:
    draw = np.random.default_rng(0)
    x = np.concatenate([np.exp(draw.normal(size=40_000) * size) for size in (0.001, 0.1, 1, 10, 20)])
    y = np.concatenate([draw.normal(size=40_000) * size for size in (20_000, 200, 20, 3, 1)])
    x, y = np.float32([*x, *-x[::40]]), np.float32([*y, *draw.integers(-20, 20, len(x[::40]))])
    x = np.where(np.abs(x) < SMALLEST, np.float32(1), x)
    power = jax.jit(jax.vmap(one_kernel(jax.lax.pow, "This")))
    with np.errstate(all="ignore"):
        _check(np.asarray(power(x, y)), np.power(x.astype(np.float64), y.astype(np.float64)), 4)
        x, y = (side.ravel() for side in np.meshgrid(ENDS, ENDS))
        _check(np.asarray(power(x, y)), np.power(x.astype(np.float64), y.astype(np.float64)), 4)


@pytest.mark.parametrize("name", ONE_OPERAND)
def test_a_known_number_is_computed_while_tracing(name: str) -> None:
    _, exact, _ = ONE_OPERAND[name]
    made = ELEMENTARY[name](Algebra(), np.float32(0.7))
    assert isinstance(made, np.float32)
    np.testing.assert_allclose(made, exact(np.float64(np.float32(0.7))), rtol=4e-7)
