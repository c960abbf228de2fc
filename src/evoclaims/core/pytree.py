"""Frozen dataclasses that jax treats as trees of arrays."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar, dataclass_transform

import jax
import jax.numpy as jnp

T = TypeVar("T")


def static(**kwargs: Any) -> Any:
    """Mark a field as part of the tree's structure, not an array: hashable, compared by equality."""
    return dataclasses.field(metadata={"static": True}, **kwargs)


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field, static))
def pytree(cls: type[T]) -> type[T]:
    """Turn a class into a frozen dataclass registered as a jax pytree; fields made by `static()` are structure."""
    return jax.tree_util.register_dataclass(dataclasses.dataclass(frozen=True)(cls))  # reads the fields' metadata


def strong(tree: T) -> T:
    """Give every leaf a strong dtype, so that a loop's carry keeps its dtypes and nothing compiles twice."""
    made: T = jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype=jnp.result_type(leaf)), tree)
    return made


def select(condition: jax.Array, on_true: T, on_false: T) -> T:
    """Choose between two trees of the same structure by a scalar condition (shape [])."""
    chosen: T = jax.tree.map(lambda a, b: jnp.where(condition, a, b), on_true, on_false)
    return chosen
