"""Evaluates a jaxpr with NumPy, without compiling it, for many inputs at a time: by the rules that kernels are made by.

Each number of an array is a vector, with its value for every input, and what a rule does with numbers is computed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import jax
import numpy as np
from numpy.typing import NDArray

from evoclaims.kernels.trace import scalarize  # noqa: F401  (it registers what primitives do)
from evoclaims.kernels.trace.algebra import Algebra
from evoclaims.kernels.trace.expressions import KNOWN, Expression, Number, Unsupported, is_known
from evoclaims.kernels.trace.interpreter import Numbers, Scalars, listed

ELEMENTARY: Final[dict[str, Callable[..., Any]]] = {
    **{name: getattr(np, name) for name in ("cos", "exp", "expm1", "log", "log1p", "pow", "sign", "sin", "square")},
    "acos": np.arccos,
    "asin": np.arcsin,
    "atan": np.arctan,
    "atan2": np.arctan2,
    "is_finite": np.isfinite,
    "logistic": lambda x: 1 / (1 + np.exp(-x)),
    "rsqrt": lambda x: 1 / np.sqrt(x),
    "seldom": np.asarray,
    "tan": np.tan,
    "tanh": np.tanh,
}
"""Operations that kernels make of simpler ones, or have not, by jax's names."""
NARROW: Final = "shift_right_logical"
"""What expressions know of 32 bits alone."""


def in_numpy(function: Callable[..., Any], *inputs: NDArray[Any]) -> list[NDArray[Any]]:
    """Return the leaves of a function's results for every row of its arguments.

    It is for what is computed once: tracing takes as long as for a compiled program, and there is no compiling.
    A primitive without a rule for kernels is compiled by jax, alone.

    Args:
        function: of small arrays, in jax.
        inputs: with a leading axis that counts inputs.
    """
    traced = jax.make_jaxpr(function)(*(jax.ShapeDtypeStruct(x.shape[1:], x.dtype) for x in inputs))
    evaluated = _Evaluated(len(inputs[0]))
    with np.errstate(all="ignore"):  # as jax, both sides of a selection are computed
        results = evaluated.run(traced, list(map(_apart, inputs)))
        return [evaluated.together(x, aval) for x, aval in zip(results, traced.out_avals, strict=True)]


@dataclass(frozen=True, eq=False, slots=True)
class _Lanes(Expression):
    """A number of which the value for every input is known, shape [inputs]."""

    values: NDArray[Any]


def _values(number: Number) -> Any:
    return number if is_known(number) else number.values


def _apart(array: NDArray[Any]) -> Numbers:
    """Return the numbers of an array that has a leading axis of inputs."""
    return listed([_Lanes(array.dtype, x) for x in array.reshape(len(array), -1).T.copy()], array.shape[1:])


class _Computing(Algebra):
    """Computes operations, where others make expressions."""

    def _shared(self, name: str, operands: tuple[Number, ...], dtype: np.dtype[Any]) -> Any:
        if name == "cast" and dtype.kind in "iu" and operands[0].dtype.kind == "f":
            raise Unsupported("floats that become integers")  # which NumPy does not limit as XLA does
        if name == "cast":
            return _Lanes(dtype, operands[0].values.astype(dtype))
        if name == "bits":
            return _Lanes(dtype, operands[0].values.view(dtype))
        return _Lanes(dtype, np.asarray(KNOWN[name](*map(_values, operands))))


class _Evaluated(Scalars):
    """Evaluates jaxprs; numbers may have any dtype."""

    def __init__(self, count: int) -> None:
        """Begin, with so many inputs."""
        super().__init__()
        self.algebra = _Computing()
        self._count = count

    def check(self, dtype: Any) -> np.dtype[Any]:
        """Take any dtype."""
        any_: np.dtype[Any] = np.dtype(dtype)
        return any_

    def together(self, x: Numbers, aval: Any) -> NDArray[Any]:
        """Return the array of numbers, with a leading axis of inputs; `aval` has its shape and dtype."""
        made = np.empty((x.size, self._count), aval.dtype)
        for row, number in zip(made, x.flat, strict=True):
            row[:] = _values(number)
        return made.T.reshape(self._count, *aval.shape)

    def _apply(self, equation: Any, operands: list[Numbers]) -> Sequence[Numbers]:
        name = equation.primitive.name
        try:
            if name == NARROW:
                return self._compiled(equation, operands)
            if name == "scan":
                return self._repeated(equation, operands)
            if name in ELEMENTARY:
                return [self.each(partial(_computed, ELEMENTARY[name], equation.outvars[0].aval.dtype), *operands)]
            return super()._apply(equation, operands)
        except Unsupported:
            return self._compiled(equation, operands)

    def _repeated(self, equation: Any, operands: list[Numbers]) -> Sequence[Numbers]:
        """Return the results of a loop."""
        p = equation.params
        inner = p["jaxpr"].jaxpr
        # What jax calls these counts differs by release: rows and results by rows have one dimension more outside.
        known = sum(a.aval.ndim == b.aval.ndim for a, b in zip(equation.invars, inner.invars, strict=True))
        carries = sum(a.aval.ndim == b.aval.ndim for a, b in zip(equation.outvars, inner.outvars, strict=True))
        fixed, carry, rows = operands[: known - carries], operands[known - carries : known], operands[known:]
        stacked = [np.empty(v.aval.shape, object) for v in equation.outvars[carries:]]
        for i in reversed(range(p["length"])) if p["reverse"] else range(p["length"]):
            results = self.run(p["jaxpr"], [*fixed, *carry, *(x[i : i + 1].reshape(x.shape[1:]) for x in rows)])
            carry = results[:carries]
            for column, row in zip(stacked, results[carries:], strict=True):
                column[i : i + 1] = row[None]
        return [*carry, *stacked]

    def _compiled(self, equation: Any, operands: list[Numbers]) -> Sequence[Numbers]:
        """Compute a primitive by jax."""
        bind = partial(equation.primitive.bind, **equation.primitive.get_bind_params(equation.params))
        given = [self.together(x, v.aval) for x, v in zip(operands, equation.invars, strict=True)]
        results = jax.jit(jax.vmap(bind, axis_size=self._count))(*given)
        return [_apart(np.asarray(x)) for x in (results if equation.primitive.multiple_results else [results])]


def _computed(function: Callable[..., Any], dtype: np.dtype[Any], *numbers: Number) -> Number:
    result = np.asarray(function(*map(_values, numbers)), dtype)
    return result[()] if all(map(is_known, numbers)) else _Lanes(dtype, result)
