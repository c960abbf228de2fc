"""Primitives that compute: sums, matrix products, triangular systems, loops."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from jax.lax import RoundingMethod

from evoclaims.kernels.trace import expressions as ex
from evoclaims.kernels.trace.elementary import power
from evoclaims.kernels.trace.expressions import Unsupported
from evoclaims.kernels.trace.interpreter import Numbers, Scalars, check, filled, listed, primitive


@primitive("integer_pow")
def _integer_pow(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    return [s.each(lambda n: power(s.algebra, n, equation.params["y"]), x)]


@primitive("select_n")
def _select_n(s: Scalars, equation: Any, which: Numbers, *cases: Numbers) -> Sequence[Numbers]:
    if len(cases) != 2 or equation.invars[0].aval.dtype != bool:
        raise Unsupported("a selection among more than two")
    return [s.elementwise("select", np.broadcast_to(which, cases[0].shape), cases[1], cases[0])]


@primitive("clamp")
def _clamp(s: Scalars, equation: Any, low: Numbers, x: Numbers, high: Numbers) -> Sequence[Numbers]:
    return [s.elementwise("min", s.elementwise("max", x, low), high)]


@primitive("convert_element_type")
def _convert_element_type(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    return [s.each(lambda n: s.algebra.cast(n, equation.params["new_dtype"]), x)]


@primitive("bitcast_convert_type")
def _bitcast(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    dtype = check(equation.params["new_dtype"])
    return [s.each(lambda n: s.algebra.bits(n, dtype), x)]


IDENTITIES: Final[dict[str, Callable[[np.dtype[Any]], float]]] = {
    "add": lambda dtype: 0,
    "and": lambda dtype: -1,
    "max": lambda dtype: -np.inf if dtype.kind == "f" else np.iinfo(dtype).min,
    "min": lambda dtype: np.inf if dtype.kind == "f" else np.iinfo(dtype).max,
    "mul": lambda dtype: 1,
    "or": lambda dtype: 0,
}
"""Results of reductions over no numbers."""


@primitive("round")
def _round(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    if equation.params["rounding_method"] != RoundingMethod.TO_NEAREST_EVEN:
        raise Unsupported("rounding halves away from zero")
    return [s.elementwise("rint", x)]


@primitive("reduce_and", "reduce_max", "reduce_min", "reduce_or", "reduce_sum", "reduce_prod")
def _reduce(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    kind, aval = equation.primitive.name.removeprefix("reduce_"), equation.outvars[0].aval
    name = {"sum": "add", "prod": "mul"}.get(kind, kind)
    axes = tuple(equation.params["axes"])
    summed = math.prod(x.shape[a] for a in axes)
    if not summed:
        return [filled(aval.shape, aval.dtype.type(IDENTITIES[name](aval.dtype)))]
    rows = np.moveaxis(x, axes, range(len(axes))).reshape(summed, -1).T
    return [listed([s.fold(name, list(row)) for row in rows], aval.shape)]


@primitive("cumsum")
def _cumsum(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    step = -1 if equation.params["reverse"] else 1
    sums = np.moveaxis(x, equation.params["axis"], 0)[::step].copy()
    for i in range(1, len(sums)):
        sums[i : i + 1] = s.elementwise("add", sums[i - 1 : i], sums[i : i + 1])
    return [np.moveaxis(sums[::step], 0, equation.params["axis"])]


@primitive("dot_general")
def _dot_general(s: Scalars, equation: Any, left: Numbers, right: Numbers) -> Sequence[Numbers]:
    contracted, batch = equation.params["dimension_numbers"]
    aval = equation.outvars[0].aval

    def rows(x: Numbers, contracted: Sequence[int], batch: Sequence[int]) -> Numbers:
        """Arrange as [batch, row, contracted]."""
        free = [d for d in range(x.ndim) if d not in (*contracted, *batch)]
        sizes = [math.prod(x.shape[d] for d in dimensions) for dimensions in (batch, free, contracted)]
        cast = s.each(lambda n: s.algebra.cast(n, aval.dtype), x) if x.size else x
        return np.transpose(cast, [*batch, *free, *contracted]).reshape(sizes)

    pairs = zip(rows(left, contracted[0], batch[0]), rows(right, contracted[1], batch[1]), strict=True)
    zero = np.dtype(aval.dtype).type(0)
    products = [
        s.fold("add", [s.algebra.apply("mul", a, b) for a, b in zip(row, column, strict=True)] or [zero])
        for rows_of_left, rows_of_right in pairs
        for row in rows_of_left
        for column in rows_of_right
    ]
    return [listed(products, aval.shape)]


def _quotient(s: Scalars, a: ex.Number, b: ex.Number) -> ex.Number:
    """Return a / b, by the reciprocal of b: a factor divides many numbers by each on its diagonal."""
    return s.algebra.apply("mul", a, s.algebra.apply("div", b.dtype.type(1), b))


@primitive("cholesky")
def _cholesky(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    lower = filled(x.shape, equation.outvars[0].aval.dtype.type(0))
    for at in np.ndindex(*x.shape[:-2]):
        for row in range(x.shape[-1]):
            for column in range(row + 1):
                products = s.elementwise("mul", lower[at][row, :column], lower[at][column, :column])
                rest = s.fold("sub", [x[at][row, column], *products])
                root = row == column
                lower[at][row, column] = (
                    s.algebra.apply("sqrt", rest) if root else _quotient(s, rest, lower[at][column, column])
                )
    return [lower]


@primitive("triangular_solve")
def _triangular_solve(s: Scalars, equation: Any, matrix: Numbers, right: Numbers) -> Sequence[Numbers]:
    p = equation.params
    if not p["left_side"] or p["unit_diagonal"]:
        raise Unsupported("a triangular system from the right, or of unit diagonal")
    turned = bool(p["transpose_a"])
    rows = np.swapaxes(matrix, -1, -2) if turned else matrix
    size = range(matrix.shape[-1])
    solution = right.copy()
    forward = p["lower"] != turned
    for at in np.ndindex(*matrix.shape[:-2]):
        for i in size if forward else reversed(size):
            for j in size[:i] if forward else size[i + 1 :]:
                product = s.elementwise("mul", rows[at][i, j : j + 1], solution[at][j])
                solution[at][i] = s.elementwise("sub", solution[at][i], product)
            solution[at][i] = s.each(lambda a, b: _quotient(s, a, b), solution[at][i], rows[at][i, i : i + 1])
    return [solution]


@primitive("scan")
def _scan(s: Scalars, equation: Any, *operands: Numbers) -> Sequence[Numbers]:
    """A loop that only carries values; scanning over the rows of arrays is not supported."""
    inner, rounds = equation.params["jaxpr"], equation.params["length"]
    shapes = [v.aval.shape for v in inner.jaxpr.invars]
    fresh = len(equation.outvars)
    if [o.shape for o in operands] != shapes or [v.aval for v in equation.outvars] != inner.out_avals:
        raise Unsupported("a scan over rows")
    if not rounds:
        return operands[len(operands) - fresh :]
    constants, start = operands[: len(operands) - fresh], operands[len(operands) - fresh :]
    carried = [
        listed([ex.Carried(np.dtype(v.aval.dtype)) for _ in x.flat], x.shape)
        for v, x in zip(equation.outvars, start, strict=True)
    ]
    results = s.run(inner, [*constants, *carried])
    flat = [[n for array in arrays for n in array.flat] for arrays in (carried, start, results)]
    around = ex.loop(rounds, *flat)
    outcomes = iter([ex.LoopResult(c.dtype, around, place) for place, c in enumerate(around.carried)])
    return [listed([next(outcomes) for _ in x.flat], x.shape) for x in start]
