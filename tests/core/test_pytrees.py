"""Frozen dataclasses as trees of arrays."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.core.pytree import pytree, select, static, strong


@pytree
class Point:
    x: Any
    y: Any
    label: str = static(default="p")


def test_leaves_are_fields_by_their_names_and_a_static_one_is_structure() -> None:
    paths, _ = jax.tree_util.tree_flatten_with_path(Point(1, {"z": 2}))
    assert [(jax.tree_util.keystr(path), leaf) for path, leaf in paths] == [(".x", 1), (".y['z']", 2)]
    with pytest.raises(dataclasses.FrozenInstanceError):
        Point(1, 2).x = 3
    assert jax.tree.structure(Point(1, 2, "a")) == jax.tree.structure(Point(3, 4, "a"))
    assert jax.tree.structure(Point(1, 2, "a")) != jax.tree.structure(Point(1, 2, "b"))
    with pytest.raises(ValueError, match="label|Mismatch|metadata"):
        jax.tree.map(lambda a, b: a, Point(1, 2, "a"), Point(1, 2, "b"))


def test_strong_leaves_keep_values_and_dtypes_and_lose_weak_types() -> None:
    tree = {"f": 1.5, "i": 3, "b": True, "h": jnp.float16(2), "n": np.arange(3, dtype=np.int32), "k": jax.random.key(1)}
    made = strong(tree)
    assert not any(leaf.weak_type for leaf in jax.tree.leaves(jax.eval_shape(lambda: strong(tree))))
    assert {name: str(leaf.dtype) for name, leaf in made.items() if name != "k"} == {
        "f": "float32",
        "i": "int32",
        "b": "bool",
        "h": "float16",
        "n": "int32",
    }
    assert made["f"] == 1.5
    assert made["n"].tolist() == [0, 1, 2]
    assert jax.random.key_data(made["k"]).tolist() == jax.random.key_data(jax.random.key(1)).tolist()


def test_select_takes_the_whole_of_one_tree() -> None:
    one, other = Point(jnp.zeros(3), jnp.int32(1)), Point(jnp.ones(3), jnp.int32(2))
    for choose in (select, jax.jit(select)):
        for condition, wanted in ((True, one), (False, other)):
            chosen = choose(jnp.asarray(condition), one, other)
            jax.tree.map(np.testing.assert_array_equal, chosen, wanted)
    batch = jax.vmap(select, in_axes=(0, None, None))(jnp.array([True, False]), one, other)
    assert batch.y.tolist() == [1, 2]
