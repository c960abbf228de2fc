"""Functions as one kernel do what jax does, on a machine that executes their PTX (`ptx_machine`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.core.kernels import ptx
from evoclaims.core.kernels.one_kernel import one_kernel

X = np.random.default_rng(0).normal(size=(37, 4)).astype(np.float32)  # the second block is not full
Y = np.random.default_rng(1).normal(size=(37, 4)).astype(np.float32)
I = np.random.default_rng(2).integers(-9, 9, (37, 4)).astype(np.int32)
B = X > 0.3
KEY = jax.random.key(0)
SYMMETRIC = jnp.eye(4) * 3.0
TABLE = jnp.asarray(np.arange(20, dtype=np.float32).reshape(5, 4) ** 2)


def _carries(x: Any, y: Any) -> Any:
    def swap(carry: Any, _: None) -> Any:
        a, b, n, flag = carry
        return (b, a + 0.5 * y, n + 1, ~flag), None

    return jax.lax.scan(swap, (x, x * 2, jnp.int32(0), jnp.zeros((), bool)), None, length=5)[0]


def _nested(x: Any) -> Any:
    def outer(a: Any, _: None) -> Any:
        return jax.lax.scan(lambda b, _: (b * 0.5 + x + a, None), a, None, length=3)[0], None

    return jax.lax.scan(outer, x, None, length=2)[0]


def _solve(x: Any, y: Any) -> Any:
    matrix = SYMMETRIC + jnp.outer(x, x)
    return jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(matrix), y), jnp.linalg.cholesky(matrix)


FUNCTIONS: dict[str, tuple[Callable[..., Any], tuple[Any, ...]]] = {
    "arithmetic": (lambda x, y: ((x + y) * x - y / (x + 9.0), -x, jnp.abs(y), x * 0.0 + 1.0, x / 4.0), (X, Y)),
    "roots and powers": (lambda x: (jnp.sqrt(x * x), jax.lax.rsqrt(x * x + 1.0), x**3, x**-2, jnp.square(x)), (X,)),
    "a power by a float": (lambda x: jnp.power(x, 2.0), (X,)),
    "sine and cosine": (lambda x: (jnp.sin(x * 50.0), jnp.cos(x * 50.0)), (X,)),
    "rounding": (lambda x: (jnp.floor(x * 3), jnp.ceil(x * 3), jnp.sign(x), jnp.round(x * 3), jnp.trunc(x * 3)), (X,)),
    "remainders": (
        lambda x, i: (jax.lax.rem(x * 5.0, jnp.full_like(x, 1.5)), jax.lax.rem(i, i * 0 + 4), i // 3),
        (X, I),
    ),
    "extremes": (lambda x, y: (jnp.maximum(x, y), jnp.minimum(x, y), jnp.clip(x, -0.5, 0.5), jnp.max(x)), (X, Y)),
    "not a number": (
        lambda x: (
            jnp.maximum(jnp.sqrt(x), 0.5),
            jnp.minimum(0.5, jnp.sqrt(x)),
            jnp.isfinite(jnp.sqrt(x)),
            jnp.sqrt(x) != 1,
        ),
        (X,),
    ),
    "integers": (
        lambda i: (i * i - 3, -i, jnp.abs(i), i & 3, i | 4, i ^ 5, ~i, jnp.maximum(i, 2), jnp.minimum(i, 2)),
        (I,),
    ),
    "comparisons": (lambda x, y: (x < y, x <= y, x > y, x >= y, x == x.round(), x != y), (X, Y)),
    "comparisons of integers": (lambda i: (i < 2, i <= 2, i > 2, i >= 2, i == 2, i != 2), (I,)),
    "conditions": (lambda a, b: (a & b, a | b, a ^ b, ~a, a == b, a != b, jnp.all(a), jnp.any(b)), (B, B[::-1])),
    "selection": (lambda b, x, i: (jnp.where(b, x, 2.0), jnp.where(b, i, 7), jnp.where(b, x > 0, x < -1)), (B, X, I)),
    "casts": (
        lambda x, i, b: (i.astype(float), (x * 9).astype(int), b.astype(float), b.astype(int), i.astype(bool)),
        (X, I, B),
    ),
    "sums": (lambda x: (jnp.sum(x), jnp.prod(x), jnp.cumsum(x), jnp.cumsum(x[::-1]), jnp.sum(x[:0])), (X,)),
    "products": (lambda x, y: (x @ y, jnp.outer(x, y) @ y, jnp.einsum("i,j,ij->ij", x, y, SYMMETRIC)), (X, Y)),
    "a system": (_solve, (X, Y)),
    "shapes": (
        lambda x: (x.reshape(2, 2).T, jnp.concatenate([x, x[1:3]]), jnp.stack([x, x]), jnp.tile(x, 2), jnp.pad(x, 1)),
        (X,),
    ),
    "indices": (lambda x: (x[jnp.array([2, 0])], x.at[1].set(0.0), x.at[jnp.array([0, 0])].add(1.0), x[::-2]), (X,)),
    "computed indices": (lambda i: (TABLE[i % 5], TABLE[i % 5, i % 4], jnp.take(TABLE, i % 5, axis=0)[0]), (I,)),
    "a computed slice": (lambda x, i: jax.lax.dynamic_slice(x, (i[0],), (2,)), (X, I)),
    "order": (lambda x: (jnp.argmax(x), jnp.argmin(x), jax.lax.top_k(x, 2), jnp.sort(x), jnp.argsort(x)), (X,)),
    "a loop": (_carries, (X, Y)),
    "loops in a loop": (_nested, (X,)),
    "calls": (lambda x: jax.jit(jnp.linalg.norm)(x) + jax.nn.relu(x), (X,)),
    "what is known": (lambda x: (jnp.arange(3), jnp.zeros((2, 2)), jnp.array([True, False]), jnp.zeros(0), x), (X,)),
    "an angle": (jnp.arctan2, (X, Y)),
}


@pytest.mark.usefixtures("gpu")
@pytest.mark.parametrize("case", FUNCTIONS)
def test_a_kernel_computes_what_jax_does(case: str) -> None:
    function, arguments = FUNCTIONS[case]
    expected = jax.jit(jax.vmap(function))(*arguments)
    made = jax.jit(jax.vmap(one_kernel(function)))(*arguments)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=2e-5, atol=2e-6), made, expected)
    assert jax.tree.map(lambda x: (x.shape, x.dtype), made) == jax.tree.map(lambda x: (x.shape, x.dtype), expected)


@pytest.mark.usefixtures("gpu")
def test_sine_and_cosine_are_exact_to_some_units_of_the_last_place() -> None:
    x = np.linspace(-1000, 1000, 40_001, dtype=np.float32)[:, None]
    sine, cosine = jax.vmap(one_kernel(lambda x: (jnp.sin(x), jnp.cos(x))))(x)
    assert np.abs(sine - np.sin(x.astype(np.float64))).max() < 2e-7
    assert np.abs(cosine - np.cos(x.astype(np.float64))).max() < 2e-7


@pytest.mark.usefixtures("gpu")
@pytest.mark.parametrize(
    "corner", [(0.0, 0.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0), (1.0, 1.0), (-1.0, -1.0), (1e-30, 1e30)]
)
def test_an_angle_is_right_at_corners(corner: tuple[float, float]) -> None:
    y, x = (jnp.full((1,), c, jnp.float32) for c in corner)
    np.testing.assert_allclose(jax.vmap(one_kernel(jnp.arctan2))(y, x), np.arctan2(*corner), atol=3e-7)


@pytest.mark.usefixtures("gpu")
def test_any_argument_may_be_shared_by_a_batch_of_batches() -> None:
    def function(a: Any, b: Any, c: Any, d: Any) -> Any:
        return a * 1000 + b * 100 + c * 10 + d

    def batched(f: Any) -> Any:
        inner = jax.vmap(f, (0, None, 0, None))
        return jax.vmap(inner, (0, 0, None, None))

    a, b, c, d = jnp.arange(6.0).reshape(2, 3, 1), jnp.arange(2.0)[:, None], jnp.arange(3.0)[:, None], jnp.ones(1)
    np.testing.assert_array_equal(batched(one_kernel(function))(a, b, c, d), batched(function)(a, b, c, d))


@pytest.mark.usefixtures("gpu")
def test_alone_and_in_loops_it_is_the_function_too() -> None:
    kernel = one_kernel(lambda x: x * 2 + 1)
    assert float(jax.jit(kernel)(jnp.float32(3))) == 7
    grown = jax.vmap(lambda x: jax.lax.scan(lambda c, _: (kernel(c), None), x, None, length=3)[0])(jnp.arange(4.0))
    np.testing.assert_array_equal(grown, np.arange(4.0) * 8 + 7)


@pytest.mark.usefixtures("gpu")
@pytest.mark.parametrize(
    "function",
    [
        jnp.exp,
        lambda x: x.at[jnp.int32(x[0]) % 4].set(0.0),
        lambda x: jax.lax.scan(lambda c, r: (c + r, c), 0.0, x),
        lambda x: x.astype(jnp.float16),
        lambda x: x + jax.random.uniform(jax.random.key(0)),
        lambda x: x + jax.random.uniform(KEY),
    ],
    ids=["exponentials", "writing at a computed place", "a loop over rows", "halves", "random numbers", "a random key"],
)
def test_what_cannot_be_a_kernel_runs_as_it_is(function: Callable[..., Any]) -> None:
    calls = []
    expected = jax.vmap(function)(X)
    jax.ffi.ffi_call = lambda *_: calls.append(1)  # type: ignore[assignment]  (the fixture puts it back)
    made = jax.vmap(one_kernel(function))(X)
    jax.tree.map(np.testing.assert_array_equal, made, expected)
    assert not calls


def test_a_machine_without_a_gpu_sees_the_function_itself() -> None:
    def function(x: Any) -> Any:
        return jnp.sin(x) * 2

    ours, plain = (jax.jit(jax.vmap(f)).lower(X).as_text() for f in (one_kernel(function), function))
    assert ours.partition("\n")[2] == plain.partition("\n")[2]


def test_a_program_for_both_platforms_has_the_kernel_on_the_gpu_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evoclaims.core.kernels.one_kernel._has_gpu", lambda: True)
    traced = jax.jit(jax.vmap(one_kernel(lambda x: x * 2))).trace(X)
    assert traced.lower(lowering_platforms=("cuda",)).as_text().count("__gpu$xla.gpu.ptx") == 1
    assert "custom_call" not in traced.lower(lowering_platforms=("cpu",)).as_text()
    np.testing.assert_array_equal(traced.lower().compile()(X), X * 2)


@pytest.mark.usefixtures("gpu")
@given(st.lists(st.floats(-4, 4, width=32), min_size=6, max_size=6))
@settings(max_examples=50, deadline=None)
def test_sorting_keeps_the_order_of_equals(values: list[float]) -> None:
    x = jnp.round(jnp.array([values], jnp.float32)) + 0.0  # without -0, which jax puts before 0

    def both(x: Any) -> Any:
        return jnp.argsort(x), jax.lax.top_k(x, 3)

    made, expected = jax.vmap(one_kernel(both))(x), jax.vmap(both)(x)
    jax.tree.map(np.testing.assert_array_equal, made, expected)


def test_the_head_of_a_kernel_names_the_capability_that_is_asked_for() -> None:
    assert f".target sm_{round(ptx.CAPABILITY * 10)}\n" in ptx.HEAD
