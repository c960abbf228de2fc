"""A GPU's kernel whose threads compute an element's parts does what the same kernel does on this processor.

Numbers here are small integers, of which every sum is exact, in whatever order. So are results equal.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from block_machine import run_parts
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.envs.ecorobot.locomotion import Obstacles
from evoclaims.envs.ecorobot.robot_task import limbs_of
from evoclaims.envs.ecorobot.robots import ANT
from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.kernels import seldom
from evoclaims.kernels.call.kernel import Kernel
from evoclaims.kernels.emit import part_kernel
from evoclaims.kernels.emit.parts import Parts
from evoclaims.kernels.trace.scalarize import scalarize

LIMBS, JOINTS, TORSO = 4, 2, 3
SIDES = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]], np.float32)
"""Limbs mirror each other."""
Function = Callable[[Any, Any], Any]


def _parts(function: Function) -> tuple[Parts, list[Any], Kernel]:
    """Return what is packed of a function of limbs [LIMBS, JOINTS] and a torso [TORSO], its results and its kernel."""
    shapes = jax.ShapeDtypeStruct((LIMBS, JOINTS), np.float32), jax.ShapeDtypeStruct((TORSO,), np.float32)
    kernel = Kernel(function, "This", jax.tree.structure(shapes), shapes)
    made = scalarize(kernel._traced, mirrors=True)
    results = [made[i] for i in kernel.written]
    places = [[(0, JOINTS * limb + joint) for joint in range(JOINTS)] for limb in range(LIMBS)]
    return Parts([n for r in results for n in r.flat], places), results, kernel


def _check(function: Function, rows: int = 3, seed: int = 0) -> Parts:
    """Check that parts compute together what this processor's kernel does; return what is packed."""
    parts, results, kernel = _parts(function)
    draw = np.random.default_rng(seed)
    leaves = [draw.integers(-3, 4, (rows, *shape.shape)).astype(np.float32) for shape in kernel.shapes]
    text = part_kernel.text(parts, results, kernel.read, dict.fromkeys(kernel.read, 1), rows)
    outputs = [jax.ShapeDtypeStruct((rows, *kernel.outputs[i].shape), kernel.outputs[i].dtype) for i in kernel.written]
    made = run_parts(text, LIMBS, rows, [leaves[i] for i in kernel.read], outputs)
    expected = kernel.on_host(*map(jnp.asarray, leaves))
    for i, result in zip(kernel.written, made, strict=True):
        np.testing.assert_array_equal(result, expected[i])
    return parts


def _walk(limbs: Any, torso: Any) -> Any:
    """Move limbs, which push the torso, which pulls them; where a limb is far out, both."""

    def round_(carry: Any, _: Any) -> Any:
        limbs, torso = carry
        reach = SIDES * limbs + torso[:JOINTS] * SIDES
        far = seldom(jnp.abs(reach) > 5)
        torso = torso + jnp.sum(reach[:, :1] * reach[:, 1:], axis=0) - jnp.where(jnp.any(far), torso[0], 0.0)
        limbs = jnp.clip(limbs - torso[2] * SIDES + jnp.where(far, reach, 0.0), -4.0, 4.0)
        return (limbs, jnp.clip(torso, -4.0, 4.0)), None

    (limbs, torso), _ = jax.lax.scan(round_, (limbs, torso), None, length=3)
    return {
        "limbs": limbs,
        "torso": torso,
        "sum": jnp.sum(limbs),
        "any": limbs > torso[0],
        "which": jnp.argmax(limbs[:, 0]),
    }


def test_limbs_that_push_a_torso_do_so_together() -> None:
    parts = _check(_walk, rows=9)  # more than one block has
    assert len(parts.packs) > 20
    assert len(parts.totals) >= TORSO - 1
    assert parts.share() < 0.75


def test_limbs_that_differ_in_more_than_signs_are_not_one() -> None:
    def function(limbs: Any, torso: Any) -> Any:
        return limbs[0] * torso[0], limbs[1] + torso[0], jnp.abs(limbs[2]), limbs[3] > 0

    parts = _check(function)
    assert not [pack for pack in parts.packs if not hasattr(pack[0], "array")]


def test_a_limb_s_number_may_go_to_another_limb() -> None:
    def function(limbs: Any, torso: Any) -> Any:
        around = jnp.roll(limbs, 1, axis=0)
        return limbs * around + jnp.array([[1.0], [2.0], [3.0], [4.0]]), jnp.max(around, axis=0), torso * limbs[2, 1]

    _check(function)


def test_operations_of_other_types_are_no_pack() -> None:
    def of_all(numbers: Any) -> Any:
        return (numbers[0] + numbers[1]) * (numbers[2] + numbers[3])

    def function(limbs: Any, torso: Any) -> Any:
        count = of_all((limbs[:, 0] > 0).astype(jnp.int32))
        total = of_all(jnp.abs(limbs[:, 0]) * 2.0 + 1.0)  # made in as many operations
        given = count + 1, count + 2, total > 30, total > 40  # each is cast for a limb
        return jnp.stack([limbs[limb] * one.astype(jnp.float32) for limb, one in enumerate(given)])

    _check(function)


def test_loops_in_a_loop_are_left_to_one_thread() -> None:
    def function(limbs: Any, torso: Any) -> Any:
        def inner(carry: Any, _: Any) -> Any:
            return carry + limbs, None

        def outer(carry: Any, _: Any) -> Any:
            return jax.lax.scan(inner, carry, None, length=2)[0] * 2.0, None

        return jax.lax.scan(outer, limbs + torso[0], None, length=2)[0]

    parts, _, _ = _parts(function)
    assert not parts.work
    assert parts.share() == 1


def test_parts_that_do_not_divide_a_warp_are_refused() -> None:
    parts, results, kernel = _parts(lambda limbs, torso: limbs * torso[0])
    parts.count = 3
    with pytest.raises(ValueError, match="3 parts, which do not divide a warp of 32"):
        part_kernel.text(parts, results, kernel.read, {}, 1)


@st.composite
def _functions(draw: st.DrawFn) -> Function:
    """Draw steps, each of which changes the limbs or the torso."""
    steps: Sequence[tuple[str, int, int]] = draw(
        st.lists(
            st.tuples(
                st.sampled_from(("mirror", "pull", "push", "gather", "turn", "pick", "seldom", "bend", "count")),
                st.integers(0, JOINTS - 1),
                st.integers(0, LIMBS - 1),
            ),
            min_size=2,
            max_size=6,
        )
    )
    in_loop = draw(st.booleans())

    def once(limbs: Any, torso: Any) -> Any:
        for name, joint, limb in steps:
            match name:
                case "mirror":
                    limbs = limbs * SIDES - torso[joint]
                case "pull":
                    limbs = limbs - torso[:JOINTS] * SIDES
                case "push":
                    torso = torso + jnp.sum(limbs[:, joint] * SIDES[:, 1] - limbs[:, 0])
                case "gather":
                    torso = torso - limbs[:, joint] @ limbs[:, 1 - joint]
                case "turn":
                    limbs = jnp.where(limbs > torso[joint], limbs[:, ::-1], -limbs)
                case "pick":
                    torso = torso.at[joint].add(limbs[limb, joint] * torso[2])
                case "count":
                    torso = torso - jnp.sum(limbs[:, joint] > torso[joint]).astype(jnp.float32)
                case "seldom":
                    limbs = jnp.where(seldom(limbs[:, :1] > 2), limbs + torso[0], limbs)
                case _:
                    limbs = limbs.at[limb, joint].add(jnp.abs(torso[joint]))
            limbs, torso = jnp.clip(limbs, -4.0, 4.0), jnp.clip(torso, -4.0, 4.0)
        return limbs, torso

    def function(limbs: Any, torso: Any) -> Any:
        if in_loop:
            return jax.lax.scan(lambda carry, _: (once(*carry), None), (limbs, torso), None, length=2)[0]
        return once(limbs, torso)

    return function


@pytest.mark.oldest  # LLVM's affair; what jaxprs become is tested on both ends by the kernels of one warp
@given(_functions(), st.integers(0, 99))
@settings(max_examples=25, deadline=None)
def test_parts_compute_together_what_one_thread_does(function: Function, seed: int) -> None:
    _check(function, rows=2, seed=seed)


def test_an_ant_has_limbs_and_robots_with_two_legs_or_none_have_not() -> None:
    limbs = SteppingStones(robot=ANT).scene.limbs
    assert [[list(map(int, numbers)) for numbers in limb] for limb in limbs] == [
        [[7 + 2 * leg, 8 + 2 * leg], [6 + 2 * leg, 7 + 2 * leg]] for leg in range(4)
    ]
    assert Obstacles().scene.limbs == []
    assert SteppingStones().scene.limbs == []


@pytest.mark.slow
def test_an_ant_s_legs_make_its_step_together() -> None:
    task = SteppingStones(robot=ANT)
    state = jax.vmap(task.reset, (0, None))(jax.random.split(jax.random.key(0), 2), jnp.int32(0))
    action = jax.random.uniform(jax.random.key(1), (2, task.action_size), minval=-1.0, maxval=1.0)
    places = jax.tree.map(lambda leaf: jnp.stack([jnp.asarray(leaf)] * 2), task.numbers)
    for _ in range(10):  # until feet are on the ground
        state = jax.jit(jax.vmap(task.step))(state, action)
    leaves, structure = jax.tree.flatten((state, action, places))
    shapes = tuple(jax.ShapeDtypeStruct(leaf.shape[1:], leaf.dtype) for leaf in leaves)

    def step(state: Any, action: Any, places: Any) -> Any:
        return task.with_numbers(places).plain_step(state, action)

    kernel = Kernel(step, "This", structure, shapes, lambda state, action, places: limbs_of(task.scene, state))
    packed = kernel._packed
    assert packed is not None
    parts, results = packed
    assert parts.share() < 0.65
    text = part_kernel.text(parts, results, kernel.read, dict.fromkeys(kernel.read, 1), 2)
    outputs = [jax.ShapeDtypeStruct((2, *kernel.outputs[i].shape), kernel.outputs[i].dtype) for i in kernel.written]
    made = run_parts(text, LIMBS, 2, [np.asarray(leaves[i]) for i in kernel.read], outputs)
    for i, result in zip(kernel.written, made, strict=True):
        expected = np.asarray(kernel.on_host(*leaves)[i], np.float64)
        np.testing.assert_allclose(np.asarray(result, np.float64), expected, atol=1e-4 * max(1, np.abs(expected).max()))
