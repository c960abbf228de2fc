"""A function's jaxpr as scalar expressions: one for every number in every array.

Moving numbers (slices, transpositions, indexing) costs nothing, and known values are computed while tracing.
"""

from __future__ import annotations

import math

from jax.extend.core import ClosedJaxpr

from evoclaims.kernels.trace import (
    arithmetic,  # noqa: F401  (they register what primitives do)
    indexing,  # noqa: F401  (they register what primitives do)
)
from evoclaims.kernels.trace.expressions import Input
from evoclaims.kernels.trace.fusing import fused
from evoclaims.kernels.trace.interpreter import Numbers, Scalars, check, listed


def scalarize(traced: ClosedJaxpr) -> list[Numbers]:
    """Return the expressions of every result of a traced function.

    Args:
        traced: of small arrays; its i-th argument is array i of `Input`.

    Raises:
        Unsupported: for a primitive, a use of one, or a dtype without a scalar expression here.
    """
    for aval in traced.out_avals:
        check(aval.dtype)
    inputs = [
        listed([Input(check(aval.dtype), array, place) for place in range(math.prod(aval.shape))], aval.shape)
        for array, aval in enumerate(traced.in_avals)
    ]
    return _fused(Scalars().run(traced, inputs))


def _fused(results: list[Numbers]) -> list[Numbers]:
    """Return results with fused products."""
    numbers = iter(fused([number for result in results for number in result.flat]))
    return [listed([next(numbers) for _ in result.flat], result.shape) for result in results]
