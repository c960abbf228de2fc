"""Conditions that are nearly always False, so that a kernel may leave out what only matters where they are True."""

from __future__ import annotations

from typing import Any, Final

import jax
import numpy as np
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jaxtyping import Array, Bool


def seldom(condition: Bool[Array, "*shape"]) -> Bool[Array, "*shape"]:
    """Return the condition, and tell a kernel that it is seldom True.

    The kernel then has a second, shorter way to compute a loop's round, which it takes where the
    condition is False for all elements that are computed together. Results have the same bits either way, but for a
    zero's sign, as long as all numbers are finite.
    """
    result: Array = SELDOM.bind(condition)
    return result


SELDOM: Final = Primitive("seldom")


def _derivative(values: Any, tangents: Any) -> Any:
    return SELDOM.bind(*values), np.zeros(np.shape(values[0]), jax.dtypes.float0)


SELDOM.def_impl(lambda condition: condition)
SELDOM.def_abstract_eval(lambda condition: condition)
ad.primitive_jvps[SELDOM] = _derivative
batching.defvectorized(SELDOM)
mlir.register_lowering(SELDOM, lambda context, condition: [condition])
