"""A GPU's kernel that warps of a block share does what the same kernel does on this processor, to the bit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from block_machine import run
from hypothesis import given, settings
from hypothesis import strategies as st
from kernel_functions import FUNCTIONS

from evoclaims.envs.ecorobot.locomotion import Locomotion
from evoclaims.envs.ecorobot.robots import HOPPER
from evoclaims.kernels.call.kernel import Kernel
from evoclaims.kernels.emit import block_kernel
from evoclaims.kernels.emit.block_kernel import BlockShape
from evoclaims.kernels.emit.shared_slots import slots
from evoclaims.kernels.emit.warp_schedule import SLACK, STRETCHES, Group, assign, schedule


def _kernel(function: Callable[..., Any], arguments: Any) -> Kernel:
    """Return a function as a kernel; `arguments` have a batch dimension in front."""
    leaves, structure = jax.tree.flatten(arguments)
    return Kernel(function, "This", structure, tuple(jax.ShapeDtypeStruct(a.shape[1:], a.dtype) for a in leaves))


def _check(kernel: Kernel, leaves: list[Any], warps: int, teams: int) -> None:
    """Check that a block of warps computes what this processor's kernel does."""
    results = [kernel.results[i] for i in kernel.written]
    numbers = [number for result in results for number in result.flat]
    plan = schedule(numbers, warps)
    assert plan is not None
    shape = BlockShape(plan, slots(plan, numbers), teams)
    rows = len(leaves[0])
    text = block_kernel.text(shape, results, kernel.read, dict.fromkeys(kernel.read, 1), rows)
    outputs = [jax.ShapeDtypeStruct((rows, *kernel.outputs[i].shape), kernel.outputs[i].dtype) for i in kernel.written]
    made = run(text, shape, rows, [leaves[i] for i in kernel.read], outputs)
    expected = kernel.on_host(*map(jnp.asarray, leaves))
    for i, result in zip(kernel.written, made, strict=True):
        np.testing.assert_array_equal(_normal(result), _normal(expected[i]))


def _normal(numbers: Any) -> Any:
    """Return numbers with 0 for those that XLA lets processors flush to 0."""
    numbers = np.asarray(numbers)
    return np.where(np.abs(numbers) < np.finfo(np.float32).tiny, 0, numbers) if numbers.dtype.kind == "f" else numbers


@pytest.mark.oldest  # LLVM's affair; what jaxprs become is tested on both ends by the kernels of one warp
@pytest.mark.parametrize(
    ("case", "warps", "teams"),
    [*((case, 3, 2) for case in FUNCTIONS if case != "loops in a loop"), (next(iter(FUNCTIONS)), 1, 2)],
)
def test_warps_compute_together_what_one_does(case: str, warps: int, teams: int) -> None:
    function, arguments = FUNCTIONS[case]
    leaves = [np.asarray(leaf)[:37] for leaf in jax.tree.leaves(arguments)]  # the second team's lanes are not all used
    _check(_kernel(function, arguments), leaves, warps, teams)


@pytest.mark.slow
def test_warps_make_a_robots_step_together() -> None:
    task = Locomotion(robot=HOPPER)
    state = jax.vmap(task.reset, (0, None))(jax.random.split(jax.random.key(0), 3), jnp.int32(0))
    action = jax.random.uniform(jax.random.key(1), (3, task.action_size), minval=-1.0, maxval=1.0)
    kernel = _kernel(task.plain_step, (state, action))
    for _ in range(20):  # until feet are on the ground
        state = jax.tree.unflatten(kernel.structure, kernel.on_host(*jax.tree.leaves((state, action))))
    _check(kernel, [np.asarray(leaf) for leaf in jax.tree.leaves((state, action))], warps=4, teams=2)


def test_a_loop_in_a_loop_is_left_to_one_warp() -> None:
    function, arguments = FUNCTIONS["loops in a loop"]
    assert schedule([number for result in _kernel(function, arguments).results for number in result.flat], 2) is None


@pytest.mark.parametrize(
    ("elements", "warps", "teams"),
    [(1, 8, 1), (132 * 32, 8, 1), (132 * 32 + 1, 4, 2), (10_240, 4, 3), (3 * 132 * 32, 4, 3)],
)
def test_all_elements_are_computed_at_once_by_as_many_warps_as_have_registers(
    elements: int, warps: int, teams: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(block_kernel, "SMALL", 10)
    shape = block_kernel.chosen(_kernel(lambda x: jnp.sin(x) * x[::-1], (jnp.ones((1, 4)),)).results, elements)
    assert shape is not None
    assert (shape.warps, shape.teams) == (warps, teams)


def test_a_warp_has_elements_of_its_own_where_sharing_is_no_faster_or_impossible(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    results = _kernel(lambda x: jnp.sin(x) * x[::-1], (jnp.ones((1, 4)),)).results
    assert block_kernel.chosen(results, 1) is None  # its code is small
    monkeypatch.setattr(block_kernel, "SMALL", 10)
    assert block_kernel.chosen(results, 1) is not None
    assert block_kernel.chosen(results, 3 * 132 * 32 + 1) is None  # elements enough for all warps


def test_blocks_of_a_long_kernel_take_turns_where_elements_are_enough_for_all_warps(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(block_kernel, "SMALL", 10)
    monkeypatch.setattr(block_kernel, "IN_TURNS", 11)
    shape = block_kernel.chosen(_kernel(lambda x: jnp.sin(x) * x[::-1], (jnp.ones((1, 4)),)).results, 3 * 132 * 32 + 1)
    assert shape is not None
    assert (shape.warps, shape.teams) == (4, 2)


def test_fewer_warps_share_the_work_where_shared_memory_is_scarce(monkeypatch: pytest.MonkeyPatch) -> None:
    def function(x: Any) -> Any:
        sums = jnp.cumsum(jnp.sin(x) * x[::-1])
        return sums * jnp.cos(sums)

    monkeypatch.setattr(block_kernel, "SMALL", 10)
    results = _kernel(function, (jnp.ones((1, 16)),)).results
    widest = block_kernel.chosen(results, 1)
    assert widest is not None
    memory = widest.shared_bytes - 1
    monkeypatch.setattr(block_kernel, "processors_and_memory", lambda: (132, memory))
    narrower = block_kernel.chosen(results, 1)
    assert narrower is not None
    assert (widest.warps, narrower.warps) == (8, 4)
    assert narrower.shared_bytes <= memory
    memory = 127  # not even one number for each of a team's elements
    assert block_kernel.chosen(results, 1) is None


@st.composite
def _graphs(draw: st.DrawFn) -> list[Group]:
    """Draw groups of operations, each of which reads earlier ones."""
    groups: list[Group] = []
    for at in range(draw(st.integers(0, 60))):
        makers = draw(st.lists(st.integers(0, at - 1), max_size=4, unique=True)) if at else []
        groups.append(Group(draw(st.integers(1, 9)), {maker: maker for maker in makers}))
    return groups


@given(_graphs(), st.integers(1, 8))
@settings(max_examples=60, deadline=None)
def test_every_group_has_a_warp_and_no_warp_much_more_than_its_share(groups: list[Group], warps: int) -> None:
    warp_of = assign(groups, warps)
    assert len(warp_of) == len(groups)
    assert set(warp_of) <= set(range(warps))
    total, largest = sum(group.instructions for group in groups), max((g.instructions for g in groups), default=0)
    for warp in range(warps):
        load = sum(group.instructions for group, w in zip(groups, warp_of, strict=True) if w == warp)
        assert load <= 3 * SLACK * total / warps + STRETCHES * largest
