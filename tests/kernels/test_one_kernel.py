"""Functions as one kernel do what jax does, on this machine's processor; and a GPU's kernels can be assembled."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from assembler import assemble, kernels_for_gpus
from hypothesis import example, given, settings
from hypothesis import strategies as st
from kernel_functions import FUNCTIONS, NO_KERNELS, X, Y

from evoclaims.kernels.call.kernel import Kernel, one_kernel
from evoclaims.kernels.emit import block_kernel, gpu_kernel, machine_code
from evoclaims.kernels.trace.algebra import Algebra
from evoclaims.kernels.trace.elementary import WIDEST
from evoclaims.kernels.trace.expressions import Input


@pytest.mark.parametrize("case", FUNCTIONS)
def test_a_kernel_computes_what_jax_does(case: str) -> None:
    function, arguments = FUNCTIONS[case]
    expected = jax.jit(jax.vmap(function))(*arguments)
    made = jax.jit(jax.vmap(one_kernel(function, "This")))(*arguments)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=2e-5, atol=2e-6), made, expected)
    assert jax.tree.map(lambda x: (x.shape, x.dtype), made) == jax.tree.map(lambda x: (x.shape, x.dtype), expected)


@pytest.mark.parametrize("case", FUNCTIONS)
def test_nvidias_assembler_takes_every_kernel(case: str, tmp_path: Path) -> None:
    function, arguments = FUNCTIONS[case]
    (ptx,) = kernels_for_gpus(jax.vmap(one_kernel(function, "This")), *arguments)
    assert ".visible .entry this(" in ptx  # the name that profilers show
    assert ".minnctapersm 1" in ptx  # else ptxas may keep half of the registers for a second block
    assemble(ptx, tmp_path)


@pytest.mark.parametrize(("name", "symbol"), [("A step of 3 Übungen!", "a_step_of_3_bungen"), ("3 β", "kernel_3")])
def test_a_kernel_is_named_after_what_it_computes_in_letters_that_the_assembler_takes(
    name: str, symbol: str, tmp_path: Path
) -> None:
    (ptx,) = kernels_for_gpus(jax.vmap(one_kernel(lambda x: x + 1, name)), jnp.ones((5, 2)))
    assert f".visible .entry {symbol}(" in ptx
    assemble(ptx, tmp_path)


def test_a_kernel_is_written_once_for_all_programs_that_call_it(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []
    chosen = block_kernel.chosen

    def counted(results: Any, elements: int) -> Any:
        calls.append(elements)
        return chosen(results, elements)

    monkeypatch.setattr(block_kernel, "chosen", counted)
    run = jax.vmap(one_kernel(lambda x: x + 1, "This"))
    first, again = (kernels_for_gpus(lambda x, n=n: n * run(x), jnp.ones((5, 2))) for n in (2, 3))
    other = kernels_for_gpus(run, jnp.ones((6, 2)))
    assert first == again != other
    assert calls == [5, 6]


@pytest.mark.parametrize(("widest", "error"), [(10_000, 1e-7), (WIDEST, 6e-7)])
def test_sine_and_cosine_are_wrong_by_little(widest: float, error: float) -> None:
    x = np.linspace(-widest, widest, 40_001, dtype=np.float32)[1:-1, None]
    sine, cosine = jax.vmap(one_kernel(lambda x: (jnp.sin(x), jnp.cos(x)), "This"))(x)
    assert np.abs(sine - np.sin(x.astype(np.float64))).max() < error
    assert np.abs(cosine - np.cos(x.astype(np.float64))).max() < error


def test_sine_and_cosine_of_wider_angles_are_not_a_number() -> None:
    assert np.isnan(
        jax.vmap(one_kernel(lambda x: jnp.sin(x) + jnp.cos(x), "This"))(jnp.array([2 * WIDEST, -2 * WIDEST]))
    ).all()


@pytest.mark.parametrize("value", [3e9, -3e9, np.inf, np.nan, -1.9])
def test_floats_become_integers_as_in_jax(value: float) -> None:
    x = np.full(3, value, np.float32)
    expected = jax.jit(lambda x: x.astype(int))(x)
    np.testing.assert_array_equal(jax.vmap(one_kernel(lambda x: x.astype(int), "This"))(x), expected)
    assert Algebra().cast(x[0], np.int32) == expected[0]  # one that is known


def test_a_batch_of_nothing_is_nothing() -> None:
    assert jax.vmap(one_kernel(lambda x: x * 2, "This"))(jnp.zeros((0, 3))).shape == (0, 3)


@pytest.mark.parametrize(
    "corner", [(0.0, 0.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0), (1.0, 1.0), (-1.0, -1.0), (1e-30, 1e30)]
)
def test_an_angle_is_right_at_corners(corner: tuple[float, float]) -> None:
    y, x = (jnp.full((1,), c, jnp.float32) for c in corner)
    np.testing.assert_allclose(jax.vmap(one_kernel(jnp.arctan2, "This"))(y, x), np.arctan2(*corner), atol=3e-7)


def test_operations_are_one_object_exactly_if_they_are_equal() -> None:
    """Those whose operands may change places are, in either order; of known numbers the bits count."""
    algebra, (a, b) = Algebra(), (Input(np.dtype(np.float32), 0, at) for at in range(2))
    made = [(name, *pair) for name in ("add", "sub", "lt", "max") for pair in ((a, b), (b, a), (a, np.float32(2)))]
    made += [("max", a, np.float32(0.0)), ("max", a, np.float32(-0.0))]
    alike = {}
    for name, one, other in made:
        key = frozenset((repr(one), repr(other))) if name in ("add", "max") else (repr(one), repr(other))
        alike.setdefault((name, key), set()).add(id(algebra.apply(name, one, other)))
    assert {len(objects) for objects in alike.values()} == {1}
    assert len(set().union(*alike.values())) == len(alike)


def test_any_argument_may_be_shared_by_a_batch_of_batches() -> None:
    def function(a: Any, b: Any, c: Any, d: Any) -> Any:
        return a * 1000 + b * 100 + c * 10 + d

    def batched(f: Any) -> Any:
        inner = jax.vmap(f, (0, None, 0, None))
        return jax.vmap(inner, (0, 0, None, None))

    a, b, c, d = jnp.arange(6.0).reshape(2, 3, 1), jnp.arange(2.0)[:, None], jnp.arange(3.0)[:, None], jnp.ones(1)
    np.testing.assert_array_equal(batched(one_kernel(function, "This"))(a, b, c, d), batched(function)(a, b, c, d))


def test_alone_and_in_loops_it_is_the_function_too() -> None:
    kernel = one_kernel(lambda x: x * 2 + 1, "This")
    assert float(jax.jit(kernel)(jnp.float32(3))) == 7
    grown = jax.vmap(lambda x: jax.lax.scan(lambda c, _: (kernel(c), None), x, None, length=3)[0])(jnp.arange(4.0))
    np.testing.assert_array_equal(grown, np.arange(4.0) * 8 + 7)


@pytest.mark.parametrize("function", NO_KERNELS.values(), ids=NO_KERNELS)
def test_what_cannot_be_a_kernel_runs_as_it_is(function: Callable[..., Any]) -> None:
    expected = jax.vmap(function)(X)
    with pytest.warns(UserWarning, match="^This is not one kernel, and slower, because of "):
        made = jax.vmap(one_kernel(function, "This"))(X)
    jax.tree.map(np.testing.assert_array_equal, made, expected)


def test_each_platform_has_its_own_kernel_and_others_the_function() -> None:
    traced = jax.jit(jax.vmap(one_kernel(lambda x: x * 2, "This"))).trace(X)

    def lowered(platform: str) -> str:
        return traced.lower(lowering_platforms=(platform,)).as_text()

    assert "__gpu$xla.gpu.ptx" in lowered("cuda")
    assert "@evoclaims_" in lowered("cpu")
    assert "custom_call" not in lowered("tpu")


def test_another_platform_computes_the_same_with_the_function_itself() -> None:
    function, arguments = FUNCTIONS["arithmetic"]
    kernel = Kernel(function, "This", *_shapes(*(a[0] for a in arguments)))
    expected = jax.tree.leaves(jax.vmap(function)(*arguments))
    for made, wanted in zip(kernel.as_it_is(*arguments), expected, strict=True):
        np.testing.assert_allclose(made, wanted, rtol=1e-6)


def _shapes(*arrays: Any) -> tuple[Any, tuple[jax.ShapeDtypeStruct, ...]]:
    """Return the structure and shapes of arguments."""
    shapes = tuple(jax.ShapeDtypeStruct(a.shape, a.dtype) for a in arrays)
    return jax.tree.structure(arrays), shapes


@pytest.mark.parametrize("lanes", [4, 8, 16])
@pytest.mark.parametrize("rows", [1, 2, 15, 16, 17, 37])
def test_bits_depend_neither_on_the_batch_nor_on_the_lanes(
    rows: int, lanes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def function(x: Any, y: Any) -> Any:
        return jnp.sin(x * y) / (x - y * y) + jnp.sum(x) * y, x > y, jnp.argsort(x)

    whole = jax.vmap(one_kernel(function, "This"))(X, Y)
    monkeypatch.setattr(machine_code, "lanes", lambda: lanes)
    part = jax.vmap(one_kernel(function, "This"))(X[-rows:], Y[-rows:])
    jax.tree.map(lambda a, b: np.testing.assert_array_equal(a[-rows:], b), whole, part)


def _basic(x: Any, y: Any) -> Any:
    return x + y, x - y, x * y, x / y, jnp.sqrt(x), jnp.maximum(x, y), jnp.minimum(x, y), jnp.floor(x), jnp.round(x)


BASIC = jax.jit(jax.vmap(one_kernel(_basic, "This")))
NUMBERS = st.floats(width=32, allow_subnormal=False)


@given(st.lists(NUMBERS, min_size=8, max_size=8))
@settings(max_examples=300)
@example([np.nan, np.inf, -np.inf, 0.0, 1e-30, 1e38, -3e38, np.nan])
def test_simple_operations_are_rounded_as_ieee_says(values: list[float]) -> None:
    x, y = (np.array(half, np.float32) for half in (values[:4], values[4:]))
    with np.errstate(all="ignore"):
        expected = x + y, x - y, x * y, x / y, np.sqrt(x), np.maximum(x, y), np.minimum(x, y), np.floor(x), np.rint(x)
    for place, (made, wanted) in enumerate(zip(BASIC(x, y), expected, strict=True)):
        normal = ~(np.abs(wanted) < np.finfo(np.float32).tiny)  # XLA lets processors flush smaller ones to 0
        np.testing.assert_array_equal(np.asarray(made)[normal], wanted[normal], err_msg=f"operation {place}")


SUMS = (lambda a, b, c: a * b + c, lambda a, b, c: c - a * b, lambda a, b, c: a * b - c)
FUSED = [jax.jit(jax.vmap(one_kernel(function, "This"))) for function in SUMS]  # a product used twice is not fused


@given(*[st.floats(-1e3, 1e3, width=32, allow_subnormal=False)] * 3)
@settings(max_examples=300)
def test_a_sum_with_a_product_is_rounded_once(a: float, b: float, c: float) -> None:
    for function, fused in zip(SUMS, FUSED, strict=True):
        exact = function(Fraction(a), Fraction(b), Fraction(c))
        made = Fraction(float(fused(*np.array([[a], [b], [c]], np.float32))[0]))
        nearest = np.spacing(np.float32(abs(float(exact)))) / 2
        assert abs(made - exact) <= nearest or abs(exact) < Fraction(2) ** -125  # smaller ones may be flushed to 0


def test_derivatives_are_the_functions_own() -> None:
    def function(x: Any, n: Any) -> Any:
        return jnp.sum(jnp.sin(x) * x) / 3, n + 1

    def total(f: Any) -> Any:
        return lambda x: jnp.sum(jax.vmap(lambda row: f(row, jnp.int32(1))[0])(x))

    np.testing.assert_allclose(
        jax.grad(total(one_kernel(function, "This")))(X), jax.grad(total(function))(X), rtol=1e-5
    )


@given(st.lists(st.floats(-4, 4, width=32), min_size=6, max_size=6))
@settings(max_examples=50, deadline=None)
def test_sorting_keeps_the_order_of_equals(values: list[float]) -> None:
    x = jnp.round(jnp.array([values], jnp.float32)) + 0.0  # without -0, which jax puts before 0

    def both(x: Any) -> Any:
        columns = jax.lax.sort((x, jnp.arange(6), x * x > 1.0, x[::-1] > 0.0), num_keys=1)
        return jnp.argsort(x), jax.lax.top_k(x, 3), jax.lax.top_k(x, 6), columns

    made, expected = jax.vmap(one_kernel(both, "This"))(x), jax.vmap(both)(x)
    jax.tree.map(np.testing.assert_array_equal, made, expected)


@pytest.mark.oldest
def test_expressions_go_when_their_text_is_written() -> None:
    number = jax.ShapeDtypeStruct((), jnp.float32)
    kernel = Kernel(lambda x, y: x / y + jnp.sin(x), "This", jax.tree.structure((0, 0)), (number, number))
    before = gpu_kernel.text(kernel.results, kernel.read, {0: 1, 1: 1}, 5)
    kernel.on_host(jnp.ones(5), jnp.ones(5))
    assert "results" not in vars(kernel)  # they would live as long as the process
    assert gpu_kernel.text(kernel.results, kernel.read, {0: 1, 1: 1}, 5) == before
