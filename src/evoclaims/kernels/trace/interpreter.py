"""Interprets jaxprs with expressions as numbers; the rules for primitives are in `arithmetic` and `indexing`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

import jax
import numpy as np
from jax.extend.core import Literal
from numpy.typing import NDArray

from evoclaims.kernels.trace import expressions as ex
from evoclaims.kernels.trace.algebra import Algebra
from evoclaims.kernels.trace.elementary import ELEMENTARY
from evoclaims.kernels.trace.expressions import Number, Unsupported

Numbers = NDArray[Any]
"""An array of objects, each a `Number`."""
DTYPES: Final[tuple[np.dtype[Any], ...]] = (np.dtype(np.float32), np.dtype(np.int32), np.dtype(bool))
PRIMITIVES: Final[dict[str, Callable[..., Sequence[Numbers]]]] = {}
"""By jax's names. Elementwise operations are in `KNOWN` and `ELEMENTARY` instead."""
CALLS: Final = {
    "closed_call": "call_jaxpr",
    "custom_jvp_call": "call_jaxpr",
    "custom_vjp_call": "call_jaxpr",
    "custom_vmap_call": "call",
    "jit": "jaxpr",
}
"""Primitives that call a function, and the parameter with that function."""
COMPOUND: Final = "call_hi_primitive"
"""What jax 0.12 stages for some functions, such as `jax.numpy.nonzero`; it can be lowered to simpler primitives."""


def primitive(*names: str) -> Callable[[Any], Any]:
    """Register the rule for primitives: a function of interpreter, equation and operands."""

    def register(rule: Any) -> Any:
        PRIMITIVES.update(dict.fromkeys(names, rule))
        return rule

    return register


def known(array: Any) -> Numbers:
    """Return an array as numbers."""
    array = np.asarray(array)
    return listed(list(array.reshape(-1)), array.shape)


def filled(shape: Sequence[int], number: Number) -> Numbers:
    """Return an array of copies of a number."""
    return listed([number] * int(np.prod(shape)), shape)


def listed(numbers: Sequence[Number], shape: Sequence[int]) -> Numbers:
    """Return an array of these numbers."""
    array = np.empty(len(numbers), object)
    array[:] = numbers
    return array.reshape(shape)


def check(dtype: Any) -> np.dtype[Any]:
    """Return a dtype as NumPy has it.

    Raises:
        Unsupported: when expressions cannot have it.
    """
    for known_dtype in DTYPES:
        if dtype == known_dtype:
            return known_dtype
    raise Unsupported(f"numbers of {dtype}")


class Scalars:
    """Interprets jaxprs."""

    def __init__(self, mirrors: bool = False) -> None:
        """Start without expressions; for `mirrors` see `Algebra`."""
        self.algebra = Algebra(mirrors)

    def check(self, dtype: Any) -> np.dtype[Any]:
        """Check a dtype that numbers have; see `check`."""
        return check(dtype)

    def run(self, closed: Any, operands: Sequence[Numbers]) -> list[Numbers]:
        """Return the results of a closed jaxpr."""
        jaxpr = closed.jaxpr
        try:
            constants = [known(c) for c in closed.consts]
        except TypeError as error:  # a random key, or a traced value
            raise Unsupported("a constant that is not known") from error
        values: dict[Any, Numbers] = dict(zip(jaxpr.constvars, constants, strict=True))
        values.update(zip(jaxpr.invars, operands, strict=True))

        def read(variable: Any) -> Numbers:
            if isinstance(variable, Literal):
                aval: Any = variable.aval
                return known(np.asarray(variable.val, aval.dtype))
            return values[variable]

        for equation in jaxpr.eqns:
            results = self._apply(equation, [read(v) for v in equation.invars])
            for variable, result in zip(equation.outvars, results, strict=True):
                if not all(map(ex.is_known, result.flat)):
                    self.check(variable.aval.dtype)
            values.update(zip(equation.outvars, results, strict=True))
        return [read(v) for v in jaxpr.outvars]

    def _apply(self, equation: Any, operands: list[Numbers]) -> Sequence[Numbers]:
        """Return the results of one equation."""
        name = equation.primitive.name
        if name in ELEMENTARY:
            for variable in equation.invars:
                self.check(variable.aval.dtype)
            return [self.each(lambda *numbers: ELEMENTARY[name](self.algebra, *numbers), *operands)]
        if name in ex.KNOWN:
            return [self.elementwise(name, *operands)]
        if name in CALLS:
            return self.run(equation.params[CALLS[name]], operands)
        if name == COMPOUND:
            shapes = [jax.ShapeDtypeStruct(variable.aval.shape, variable.aval.dtype) for variable in equation.invars]
            parts = jax.make_jaxpr(partial(equation.primitive.to_lojax, **equation.params))(*shapes)
            return self.run(parts, operands)
        if name not in PRIMITIVES:
            raise Unsupported(f"jax's {name}")
        return PRIMITIVES[name](self, equation, *operands)

    def each(self, function: Callable[..., Number], *operands: Numbers) -> Numbers:
        """Apply a function to the numbers at each position."""
        arrays = np.broadcast_arrays(*operands)
        return listed([function(*n) for n in zip(*(a.reshape(-1) for a in arrays), strict=True)], arrays[0].shape)

    def elementwise(self, name: str, *operands: Numbers) -> Numbers:
        """Apply a simple operation to the numbers at each position."""
        return self.each(lambda *numbers: self.algebra.apply(name, *numbers), *operands)

    def fold(self, name: str, numbers: Sequence[Number]) -> Number:
        """Combine numbers by an operation, from first to last."""
        result = numbers[0]
        for number in numbers[1:]:
            result = self.algebra.apply(name, result, number)
        return result
