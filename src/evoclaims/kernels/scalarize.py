"""A function's jaxpr as scalar expressions: one for every number in every array.

Moving numbers (slices, transpositions, indexing) costs nothing, and known values are computed while tracing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import jax

from evoclaims.kernels import (
    arithmetic,  # noqa: F401  (they register what primitives do)
    indexing,  # noqa: F401  (they register what primitives do)
)
from evoclaims.kernels.expressions import Input
from evoclaims.kernels.interpreter import Numbers, Scalars, check, listed


def scalarize(function: Callable[..., Any], *arguments: Any) -> tuple[list[Numbers], Any]:
    """Return expressions for every result of `function`, and the results' shapes as from `jax.eval_shape`.

    Args:
        function: takes trees of small arrays.
        arguments: shapes (`jax.ShapeDtypeStruct`); their i-th array is array i of `Input`.

    Raises:
        Unsupported: for a primitive, a use of one, or a dtype without a scalar expression here.
    """
    jaxpr, shape = jax.make_jaxpr(function, return_shape=True)(*arguments)
    for aval in jaxpr.out_avals:
        check(aval.dtype)
    inputs = [
        listed([Input(check(leaf.dtype), array, place) for place in range(math.prod(leaf.shape))], leaf.shape)
        for array, leaf in enumerate(jax.tree.leaves(arguments))
    ]
    return Scalars().run(jaxpr, inputs), shape
