"""A function's jaxpr as scalar expressions: one for every number of every array it makes.

Moving numbers about (slices, transpositions, indexing) costs nothing, and what is known while tracing is worked out.
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
    """Return expressions for every result of `function`, and the results' shapes as `jax.eval_shape` gives them.

    Args:
        function: of trees of small arrays.
        arguments: shapes (`jax.ShapeDtypeStruct`); the i-th array of them is array i of `Input`.

    Raises:
        Unsupported: for a primitive, a use of one, or a dtype that has no scalar expression here.
    """
    jaxpr, shape = jax.make_jaxpr(function, return_shape=True)(*arguments)
    for aval in jaxpr.out_avals:
        check(aval.dtype)
    inputs = [
        listed([Input(check(leaf.dtype), array, place) for place in range(math.prod(leaf.shape))], leaf.shape)
        for array, leaf in enumerate(jax.tree.leaves(arguments))
    ]
    return Scalars().run(jaxpr, inputs), shape
