"""A function that GPUs compute in another way: batched, in loops, and which program gets which way."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.kernels import gpus_run_kernels
from evoclaims.kernels.call.by_platform import BY_PLATFORM, by_platform
from evoclaims.kernels.emit import machine_code
from evoclaims.kernels.trace.expressions import Unsupported

X = np.random.default_rng(0).normal(size=(3, 4)).astype(np.float32)
Y = np.random.default_rng(1).normal(size=(3, 4)).astype(np.float32)
TWICE = [(0, 0), (1, 0), (0, None), (None, 1)]


def _sine(x: Any, y: Any) -> Any:
    return {"sine": jnp.sin(x) * 2 + y, "sum": x + y}


def _cosine(x: Any, y: Any) -> Any:
    return {"sine": jnp.cos(x - np.pi / 2) * 2 + y, "sum": y + x}


def _never(*_: Any) -> Any:
    raise AssertionError("traced for nothing")


def _same(made: Any, expected: Any) -> None:
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=1e-6), made, expected)


def _on_gpu(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return the results of a traced function, and whether any of it was what GPUs compute."""
    traced, shape = jax.make_jaxpr(function, return_shape=True)(*arguments)
    values: dict[Any, Any] = dict(zip(traced.jaxpr.invars, jax.tree.leaves(arguments), strict=True))
    found = False
    for equation in traced.eqns:
        assert equation.primitive is BY_PLATFORM
        made = equation.params["on_gpu"](*[values[v] for v in equation.invars])
        values.update(zip(equation.outvars, made, strict=True))
        found = True
    assert found
    return jax.tree.unflatten(jax.tree.structure(shape), [values[v] for v in traced.jaxpr.outvars])


def test_nvidias_gpus_get_one_way_and_all_others_the_function() -> None:
    traced = jax.jit(jax.vmap(by_platform(_sine, _cosine))).trace(X, Y)

    def lowered(platform: str) -> str:
        return traced.lower(lowering_platforms=(platform,)).as_text()

    for platform, own, other in (("cuda", "cosine", "sine"), ("cpu", "sine", "cosine"), ("tpu", "sine", "cosine")):
        assert f"stablehlo.{own}" in lowered(platform)
        assert f"stablehlo.{other} " not in lowered(platform)


def test_no_other_platform_traces_what_gpus_compute() -> None:
    run = jax.vmap(by_platform(_sine, _never))
    _same(jax.jit(run)(X, Y), _sine(X, Y))
    _same(run(X, Y), _sine(X, Y))
    with pytest.raises(AssertionError, match="for nothing"):
        jax.jit(run).trace(X, Y).lower(lowering_platforms=("cuda",))


@pytest.mark.parametrize("inner", TWICE)
@pytest.mark.parametrize("outer", TWICE)
def test_either_way_may_be_batched_twice(outer: tuple[int | None, ...], inner: tuple[int | None, ...]) -> None:
    def batched(function: Any) -> Any:
        return jax.vmap(jax.vmap(function, inner), outer)

    whole = np.random.default_rng(2).normal(size=(3, 3, 3)).astype(np.float32)  # all sizes alike: every axis fits
    x, y = (jnp.asarray(whole[(0,) * ((a is None) + (b is None))]) for a, b in zip(outer, inner, strict=True))
    run = batched(by_platform(_sine, _cosine))
    for made in (run(x, y), _on_gpu(run, x, y)):
        _same(made, batched(_sine)(x, y))


def test_either_way_runs_in_a_loop() -> None:
    def looped(function: Any) -> Any:
        def step(x: Any, y: Any) -> Any:
            made = function(x, y)
            return 0.1 * made["sine"], made["sum"]

        return jax.vmap(lambda x, y: jax.lax.scan(step, x[0], y))

    expected = looped(_sine)(X, Y)
    traced = jax.jit(looped(by_platform(_sine, _cosine))).trace(X, Y)
    _same(traced.lower().compile()(X, Y), expected)
    assert "cosine" in traced.lower(lowering_platforms=("cuda",)).as_text()
    _same(jax.jit(looped(by_platform(_cosine, _sine)))(X, Y), expected)


def test_derivatives_are_the_functions_own() -> None:
    def slopes(function: Any) -> Any:
        return jax.vmap(jax.grad(lambda x, y: jnp.sum(function(x, y)["sine"]), argnums=(0, 1)))(X, Y)

    _same(slopes(by_platform(_sine, _never)), slopes(_sine))


@pytest.mark.parametrize(("capability", "runs"), [("7.5", False), ("8.0", True), ("10.0", True), (None, True)])
def test_kernels_run_on_gpus_that_are_new_enough(
    capability: str | None, runs: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(jax, "devices", lambda: [SimpleNamespace(compute_capability=capability)])
    assert gpus_run_kernels() == runs


def test_kernels_run_on_no_gpu_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    def lanes() -> int:
        raise Unsupported("no compiler")

    monkeypatch.setattr(machine_code, "lanes", lanes)
    assert not gpus_run_kernels()
