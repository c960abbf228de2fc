"""Functions as one kernel do what jax does, on a machine that executes their PTX (`ptx_machine`)."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kernel_functions import FUNCTIONS, NO_KERNELS, X

from evoclaims.kernels import ptx
from evoclaims.kernels.algebra import Algebra
from evoclaims.kernels.elementary import WIDEST
from evoclaims.kernels.one_kernel import one_kernel


@pytest.mark.usefixtures("gpu")
@pytest.mark.parametrize("case", FUNCTIONS)
def test_a_kernel_computes_what_jax_does(case: str) -> None:
    function, arguments = FUNCTIONS[case]
    expected = jax.jit(jax.vmap(function))(*arguments)
    made = jax.jit(jax.vmap(one_kernel(function)))(*arguments)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=2e-5, atol=2e-6), made, expected)
    assert jax.tree.map(lambda x: (x.shape, x.dtype), made) == jax.tree.map(lambda x: (x.shape, x.dtype), expected)


@pytest.mark.skipif(shutil.which("ptxas") is None, reason="needs NVIDIA's assembler, ptxas")
@pytest.mark.usefixtures("gpu")
@pytest.mark.parametrize("case", FUNCTIONS)
def test_nvidias_assembler_takes_every_kernel(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def assemble(target: str, shapes: Any) -> Any:
        def launch(*operands: Any, kernel_data: str, **attributes: Any) -> Any:
            (tmp_path / "kernel.ptx").write_text(kernel_data)
            command = ["ptxas", "-arch=sm_80", "kernel.ptx", "-o", "kernel.cubin"]
            done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
            assert not done.returncode, done.stderr
            return [jnp.zeros(s.shape, s.dtype) for s in shapes]

        return launch

    monkeypatch.setattr(jax.ffi, "ffi_call", assemble)
    function, arguments = FUNCTIONS[case]
    jax.vmap(one_kernel(function))(*arguments)
    assert (tmp_path / "kernel.cubin").exists()


@pytest.mark.usefixtures("gpu")
@pytest.mark.parametrize(("widest", "error"), [(10_000, 1e-7), (WIDEST, 6e-7)])
def test_sine_and_cosine_are_wrong_by_little(widest: float, error: float) -> None:
    x = np.linspace(-widest, widest, 40_001, dtype=np.float32)[1:-1, None]
    sine, cosine = jax.vmap(one_kernel(lambda x: (jnp.sin(x), jnp.cos(x))))(x)
    assert np.abs(sine - np.sin(x.astype(np.float64))).max() < error
    assert np.abs(cosine - np.cos(x.astype(np.float64))).max() < error


@pytest.mark.usefixtures("gpu")
def test_sine_and_cosine_of_wider_angles_are_not_a_number() -> None:
    assert np.isnan(jax.vmap(one_kernel(lambda x: jnp.sin(x) + jnp.cos(x)))(jnp.array([2 * WIDEST, -2 * WIDEST]))).all()


@pytest.mark.usefixtures("gpu")
@pytest.mark.parametrize("value", [3e9, -3e9, np.inf, np.nan, -1.9])
def test_floats_become_integers_as_in_jax(value: float) -> None:
    x = np.full(3, value, np.float32)
    expected = jax.jit(lambda x: x.astype(int))(x)
    np.testing.assert_array_equal(jax.vmap(one_kernel(lambda x: x.astype(int)))(x), expected)
    assert Algebra().cast(x[0], np.int32) == expected[0]  # one that is known


@pytest.mark.usefixtures("gpu")
def test_a_batch_of_nothing_is_nothing() -> None:
    assert jax.vmap(one_kernel(lambda x: x * 2))(jnp.zeros((0, 3))).shape == (0, 3)


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
@pytest.mark.parametrize("function", NO_KERNELS.values(), ids=NO_KERNELS)
def test_what_cannot_be_a_kernel_runs_as_it_is(function: Callable[..., Any]) -> None:
    calls = []
    expected = jax.vmap(function)(X)
    jax.ffi.ffi_call = lambda *_: calls.append(1)  # type: ignore[assignment]  (the fixture puts it back)
    with pytest.warns(UserWarning, match="many, and slower, because of "):
        made = jax.vmap(one_kernel(function))(X)
    jax.tree.map(np.testing.assert_array_equal, made, expected)
    assert not calls


def test_a_machine_without_a_gpu_sees_the_function_itself() -> None:
    def function(x: Any) -> Any:
        return jnp.sin(x) * 2

    ours, plain = (jax.jit(jax.vmap(f)).lower(X).as_text() for f in (one_kernel(function), function))
    assert ours.partition("\n")[2] == plain.partition("\n")[2]


def test_a_program_for_both_platforms_has_the_kernel_on_the_gpu_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evoclaims.kernels.one_kernel.has_gpu", lambda: True)
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
