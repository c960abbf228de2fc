"""A switch that stays one under vmap."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.methods.neat.capacity import switch_together

BRANCHES = [lambda x, y: {"sum": x + y, "which": jnp.int32(0)}, lambda x, y: {"sum": x + 10 * y, "which": jnp.int32(1)}]


def _switch(index: Any, x: Any, y: Any) -> Any:
    return switch_together(index, BRANCHES, x, y)


def _choices(*numbers: int) -> Any:
    return jnp.array(numbers, jnp.int32)


@pytest.mark.parametrize(("indices", "which"), [((0, 0, 0), 0), ((0, 1, 0), 1), ((1, 1, 1), 1)])
def test_a_batch_runs_the_branch_of_its_largest_index(indices: tuple[int, ...], which: int) -> None:
    x, y = jnp.arange(3.0), jnp.ones(3)
    alone = jax.jit(_switch)(jnp.int32(which), x, y)
    result = jax.jit(jax.vmap(_switch))(_choices(*indices), x, y)
    assert np.asarray(result["which"]).tolist() == [which] * 3
    assert int(alone["which"]) == which
    for found in (alone, result):
        np.testing.assert_array_equal(found["sum"], np.arange(3.0) + (1, 10)[which])


def test_any_argument_may_be_shared_by_the_batch() -> None:
    x, y = jnp.arange(3.0), jnp.float32(2)
    shared = jax.vmap(_switch, (None, 0, None))(jnp.int32(1), x, y)
    np.testing.assert_array_equal(shared["sum"], np.arange(3.0) + 20)
    by_index = jax.vmap(_switch, (0, None, None))(_choices(0, 1), jnp.float32(1), y)
    assert np.asarray(by_index["sum"]).tolist() == [21.0, 21.0]


def test_a_batch_of_batches_runs_one_branch_which_may_close_over_batched_values() -> None:
    def scaled(index: Any, scale: Any, x: Any) -> Any:
        return switch_together(index, [lambda x: x + scale, lambda x: x * scale], x)

    x = jnp.arange(3.0)
    batches = jax.jit(jax.vmap(jax.vmap(scaled, (0, None, None)), (0, 0, None)))(
        jnp.array([[0, 1], [0, 0]], jnp.int32), jnp.array([2.0, 3.0]), x
    )
    np.testing.assert_array_equal(batches, [[x * 2] * 2, [x * 3] * 2])


def test_random_keys_and_loops_pass_through() -> None:
    def draw(size: int) -> Any:
        return lambda key: jnp.sum(jax.random.uniform(key, (size,))[:2])

    def loop(index: Any, key: Any) -> Any:
        def step(total: Any, key: Any) -> tuple[Any, None]:
            return total + switch_together(index, [draw(2), draw(5)], key), None

        return jax.lax.scan(step, jnp.float32(0), jax.random.split(key, 3))[0]

    keys = jax.random.split(jax.random.key(0), 2)
    together = jax.jit(jax.vmap(loop))(_choices(0, 1), keys)
    alone = [jax.jit(loop)(jnp.int32(i), keys[i]) for i in range(2)]
    np.testing.assert_allclose(together, alone, rtol=1e-6)


def test_the_batch_keeps_a_conditional_where_an_ordinary_switch_runs_all_branches() -> None:
    arguments = _choices(0, 1), jnp.ones(2), jnp.ones(2)
    ours = jax.jit(jax.vmap(_switch)).lower(*arguments).as_text()
    ordinary = jax.jit(jax.vmap(lambda i, x, y: jax.lax.switch(i, BRANCHES, x, y))).lower(*arguments).as_text()
    assert "stablehlo.case" in ours
    assert "stablehlo.case" not in ordinary
