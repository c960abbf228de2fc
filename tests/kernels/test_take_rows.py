"""Rows of a tree's arrays, taken by a kernel, are those that indexing gives."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from evoclaims.kernels.call.take_rows import take_rows
from evoclaims.kernels.emit import machine_code
from evoclaims.kernels.trace.expressions import Unsupported

taken = jax.jit(take_rows)


def _indexed(tree: Any, places: Any) -> Any:
    return jax.tree.map(lambda leaf: np.asarray(leaf)[np.asarray(places)], tree)


def _same(one: Any, other: Any) -> None:
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        assert (a.shape, a.dtype) == (b.shape, b.dtype)
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()


def _tree(rows: int, *shape: int) -> Any:
    """Return arrays in which every number has other bits, NaN among the floats."""
    size = int(np.prod((rows, *shape)))
    numbers = np.arange(size, dtype=np.int32).reshape(rows, *shape)
    floats = (numbers + 0.5).astype(np.float32)
    floats[-1] = np.nan
    others = [jnp.asarray(numbers % 2 == 0), jnp.asarray(numbers, jnp.int8), jnp.asarray(numbers, jnp.bfloat16)]
    return {"whole": jnp.asarray(numbers), "pair": (jnp.asarray(floats), jnp.arange(rows) * 2.0), "others": others}


@settings(max_examples=15)  # nearly each compiles a program of its own
@given(
    st.integers(1, 7),
    arrays.array_shapes(min_dims=0, max_dims=2, max_side=5),
    arrays.array_shapes(min_dims=0, max_dims=2, max_side=5),
    st.data(),
)
def test_rows_are_those_of_indexing(rows: int, shape: tuple[int, ...], wanted: tuple[int, ...], data: Any) -> None:
    places = data.draw(arrays.arrays(np.int32, wanted, elements=st.integers(0, rows - 1)))
    tree = _tree(rows, *shape)
    _same(taken(tree, places), _indexed(tree, places))


def test_a_place_that_there_is_not_reads_nothing_else_than_the_arrays() -> None:
    tree = _tree(3, 2)["pair"]
    _same(taken(tree, jnp.array([-1, 3, 2**31 - 1, -(2**31)], jnp.int32)), _indexed(tree, [0, 2, 2, 0]))


def test_keys_are_taken_too() -> None:
    keys = jax.random.split(jax.random.key(3), 4)
    found = taken([keys, jnp.arange(4)], jnp.array([2, 2]))
    np.testing.assert_array_equal(jax.random.key_data(found[0]), jax.random.key_data(keys)[np.array([2, 2])])
    assert taken([], jnp.array([2])) == []


def test_no_rows_and_rows_of_no_numbers() -> None:
    _same(taken(_tree(3, 2), jnp.zeros(0, jnp.int32)), _indexed(_tree(3, 2), np.zeros(0, np.int32)))
    nothing = {"none": jnp.zeros((3, 0)), "some": jnp.arange(3)}
    _same(taken(nothing, jnp.array([2])), _indexed(nothing, [2]))


@pytest.mark.parametrize("axes", [(0, 0), (None, 0), (0, None), (1, 0)])
def test_a_batch_takes_each_its_own(axes: tuple[int | None, int | None]) -> None:
    def of(axis: int | None, place: int, leaf: Any) -> Any:
        return leaf if axis is None else np.take(leaf, place, axis)

    tree = jnp.arange(24).reshape(2, 2, 6) if axes[0] is not None else jnp.arange(12).reshape(2, 6)
    places = jnp.array([[1, 0, 0], [1, 1, 0]]) if axes[1] is not None else jnp.array([1, 0, 0])
    found = jax.jit(jax.vmap(take_rows, axes))((tree,), places)[0]
    wanted = [of(axes[0], i, np.asarray(tree))[of(axes[1], i, np.asarray(places))] for i in range(2)]
    np.testing.assert_array_equal(found, np.stack(wanted))


def test_without_llvm_it_is_indexing(monkeypatch: pytest.MonkeyPatch) -> None:
    def none() -> int:
        raise Unsupported("no LLVM")

    monkeypatch.setattr(machine_code, "lanes", none)
    tree, places = _tree(4, 3), jnp.array([[3], [0]])
    assert "custom_call" not in jax.jit(lambda tree, places: take_rows(tree, places)).lower(tree, places).as_text()
    _same(jax.jit(lambda tree, places: take_rows(tree, places))(tree, places), _indexed(tree, places))


def test_one_kernel_takes_all_arrays() -> None:
    program = taken.lower(_tree(4, 3)["pair"], jnp.array([3, 0])).compile().as_text()
    assert program.count("custom-call(") == 1
    assert " gather(" not in program


@pytest.mark.parametrize("batched", [False, True])
def test_gpus_index(batched: bool) -> None:
    tree, places = _tree(4, 3)["pair"], jnp.array([3, 0])
    many = jax.jit(jax.vmap(take_rows, (None, 0)) if batched else take_rows)
    given = jnp.stack([places, places]) if batched else places
    text = many.trace(tree, given).lower(lowering_platforms=("cuda",)).as_text()
    assert "custom_call" not in text
    assert text.count('"stablehlo.gather"(') == 2
