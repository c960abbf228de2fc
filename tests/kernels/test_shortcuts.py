"""A kernel's short way: the same bits as the whole one, taken where no seldom condition is true."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from assembler import assemble, kernels_for_gpus
from hypothesis import given
from hypothesis import strategies as st
from kernel_functions import FUNCTIONS, X

from evoclaims.kernels.call.kernel import Kernel, one_kernel
from evoclaims.kernels.emit.machine_code import lanes
from evoclaims.kernels.trace import seldom as seldom_conditions
from evoclaims.kernels.trace.expressions import (
    LoopResult,
    ScalarOperation,
    in_order,
)
from evoclaims.kernels.trace.seldom import seldom


def _kernel(function: Any, *arguments: Any) -> Kernel:
    """Return a function as a kernel; arguments have a batch dimension in front."""
    leaves, structure = jax.tree.flatten(arguments)
    return Kernel(function, "This", structure, tuple(jax.ShapeDtypeStruct(a.shape[1:], a.dtype) for a in leaves))


def _loop(kernel: Kernel) -> Any:
    """Return the one loop of a kernel."""
    numbers = [n for result in kernel.results for n in result.flat]
    (around,) = {id(n.loop): n.loop for n in numbers if isinstance(n, LoopResult)}.values()
    return around


@functools.cache
def _both_ways() -> tuple[Any, Any]:
    """Return the compiled loop with its shortcut, and without."""
    function, _ = FUNCTIONS["a loop with a shortcut"]
    shape = jax.ShapeDtypeStruct((40, 4), jnp.float32)
    made = jax.jit(jax.vmap(one_kernel(function, "This"))).lower(shape, shape).compile()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("kernel_functions.seldom", lambda condition: condition)
        again = one_kernel(lambda *given: function(*given), "This")  # jax would not trace the same function again
        return made, jax.jit(jax.vmap(again)).lower(shape, shape).compile()


@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from([0.1, 0.4, 0.6, 1.0, 3.0]))
def test_both_ways_make_the_same_bits(seed: int, size: float) -> None:
    random = np.random.default_rng(seed)
    x, y = (jnp.asarray(random.normal(size=(40, 4)) * size, jnp.float32) for _ in range(2))
    made, whole = (each(x, y) for each in _both_ways())
    for a, b in zip(made, whole, strict=True):
        np.testing.assert_array_equal(a, b)


def test_the_short_way_has_no_operation_that_only_a_seldom_condition_needs() -> None:
    function, arguments = FUNCTIONS["a loop with a shortcut"]
    choice = _loop(_kernel(function, *arguments)).choice
    before = in_order([choice.condition, *choice.taken])

    def left(way: Any) -> int:
        return len(set(map(id, in_order(way))) - set(map(id, before)))

    assert left(choice.short) < left(choice.whole) / 2
    assert not any(isinstance(e, ScalarOperation) and e.name == "seldom" for e in in_order(choice.short))


def _where_two_ways_differ(x: Any) -> Any:
    """Multiply infinity by 0 on the whole way only: the result tells which one was taken."""

    def following(carry: Any, _: None) -> Any:
        return carry + jnp.where(seldom(x[1] > 0.0), 1.0, 0.0) * x[0], None

    return jax.lax.scan(following, jnp.float32(0), None, length=2)[0]


def _guards_in_turn(x: Any) -> Any:
    """Ask a second condition of what the first switches on."""

    def round_(y: Any, _: Any) -> Any:
        sorted_ = jnp.sort(y)
        y = jnp.where(seldom(y[0] > 2), sorted_, y) + 0.25
        y = jnp.where(seldom(y[-1] < y[1]), y[::-1], y)
        return jnp.where(y > 3, y - 4, y), None

    return jax.lax.scan(round_, x, None, length=4)[0]


def test_a_condition_does_not_need_what_an_earlier_one_switches_on() -> None:
    x = jax.random.uniform(jax.random.key(0), (200, 4), minval=-3.0, maxval=3.0)
    kernel = _kernel(_guards_in_turn, x)
    asked = [e.name for e in in_order([_loop(kernel).choice.condition]) if isinstance(e, ScalarOperation)]
    assert sorted(asked) == ["add", "add", "gt", "lt", "or"]  # nothing is sorted for it
    np.testing.assert_array_equal(kernel.on_host(x)[0], jax.jit(jax.vmap(_guards_in_turn))(x))


def test_the_short_way_is_taken_where_the_condition_is_false_in_all_lanes() -> None:
    width = lanes()
    x = np.zeros((3 * width, 2), np.float32)
    x[:, 0] = np.inf
    x[width + 1, 1] = 1.0  # in the second vector
    (made,) = jax.tree.leaves(jax.vmap(one_kernel(_where_two_ways_differ, "This"))(x))
    second = np.arange(3 * width) // width == 1
    np.testing.assert_array_equal(np.isnan(made), second & (x[:, 1] == 0))
    np.testing.assert_array_equal(made[~second], 0.0)


def test_threads_of_a_gpus_warp_go_the_same_way(tmp_path: Path) -> None:
    """Those that differ would execute both ways, one after the other."""
    function, arguments = FUNCTIONS["a loop with a shortcut"]
    (ptx,) = kernels_for_gpus(jax.vmap(one_kernel(function, "This")), *arguments)
    assert "vote.sync.any.pred" in ptx
    assemble(ptx, tmp_path)


def test_a_loop_that_depends_on_a_seldom_condition_has_no_shortcut() -> None:
    def function(x: Any) -> Any:
        def outer(carry: Any, _: None) -> Any:
            start = jnp.where(seldom(carry > 1.0), carry, 0.0)
            return jax.lax.scan(lambda a, _: (a * 0.5 + x, None), start, None, length=2)[0], None

        return jax.lax.scan(outer, x, None, length=3)[0]

    kernel = _kernel(function, X)
    assert _loop(kernel).choice is None
    np.testing.assert_allclose(kernel.on_host(jnp.asarray(X))[0], jax.vmap(function)(X), rtol=1e-6)


def test_a_seldom_condition_is_the_condition_elsewhere() -> None:
    condition = jnp.array([[True, False], [False, False]])
    np.testing.assert_array_equal(seldom(condition), condition)
    np.testing.assert_array_equal(jax.jit(jax.vmap(jax.vmap(seldom)))(condition), condition)
    slope = jax.grad(lambda x: jnp.sum(jnp.where(seldom(x > 0), x * x, 0.0)))(jnp.array([-1.0, 3.0]))
    np.testing.assert_array_equal(slope, [0.0, 6.0])
    assert seldom_conditions.SELDOM.name == "seldom"  # as `expressions.KNOWN` has it
    outside = one_kernel(lambda x: jnp.where(seldom(x > 0), x, -x), "This")  # of a loop
    np.testing.assert_array_equal(jax.vmap(outside)(X), np.abs(X))
