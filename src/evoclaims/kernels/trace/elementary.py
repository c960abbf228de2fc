"""Functions made of simple operations: sine, cosine, arc tangent, whole powers, signs; `exponentials` has others."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np

from evoclaims.kernels.trace import exponentials
from evoclaims.kernels.trace.algebra import Algebra
from evoclaims.kernels.trace.exponentials import polynomial
from evoclaims.kernels.trace.expressions import Number, Unsupported, is_known

F = np.float32
LARGEST_POWER: Final = 16
WIDEST: Final = 50_000.0
"""Largest angle, rad, whose quadrant is found accurately."""
PIO2: Final = (F(1.5703125), F(4.837512969970703125e-4), F(7.549789948768648e-8))
"""π/2 in three parts (Cody and Waite): a small multiple of the first two is exact."""
SINE: Final = (-1.9515295891e-4, 8.3321608736e-3, -1.6666654611e-1)
"""Coefficients of sinf, cosf and atanf in Moshier's Cephes library, highest power first."""
COSINE: Final = (2.443315711809948e-5, -1.388731625493765e-3, 4.166664568298827e-2)
ARC_TANGENT: Final = (8.05374449538e-2, -1.38776856032e-1, 1.99777106478e-1, -3.33329491539e-1)


def _circular(quarters: int, a: Algebra, x: Number) -> Number:
    """Return the sine of x + `quarters` · π/2 (Cephes).

    The error is below 1e-7 for |x| < 10,000, and below 6e-7 for |x| < `WIDEST`; beyond that it returns NaN.
    """
    near = a.apply("lt", a.apply("abs", x), F(WIDEST))
    turns = a.apply("rint", a.apply("mul", x, F(2 / np.pi)))
    for part in PIO2:
        x = a.apply("sub", x, a.apply("mul", turns, part))
    z = a.apply("mul", x, x)
    sine = a.apply("add", x, a.apply("mul", a.apply("mul", x, z), polynomial(a, z, SINE)))
    near_one = a.apply("sub", F(1), a.apply("mul", z, F(0.5)))
    cosine = a.apply("add", near_one, a.apply("mul", a.apply("mul", z, z), polynomial(a, z, COSINE)))
    quadrant = a.apply("add", a.cast(turns, np.int32), np.int32(quarters))
    odd = a.apply("ne", a.apply("and", quadrant, np.int32(1)), np.int32(0))
    lower_half = a.apply("ne", a.apply("and", quadrant, np.int32(2)), np.int32(0))
    value = a.apply("select", odd, cosine, sine)
    value = a.apply("select", lower_half, a.apply("neg", value), value)
    return a.apply("select", near, value, F(np.nan))


def _atan2(a: Algebra, y: Number, x: Number) -> Number:
    """Return the angle of (x, y), both finite; a zero has no sign here.

    It is the arc tangent of the smaller coordinate over the larger, moved to its octant.
    """
    wide, high = a.apply("abs", x), a.apply("abs", y)
    steep = a.apply("gt", high, wide)
    larger, smaller = a.apply("select", steep, high, wide), a.apply("select", steep, wide, high)
    at_origin = a.apply("eq", larger, F(0))
    t = a.apply("select", at_origin, F(0), a.apply("div", smaller, larger))
    far = a.apply("gt", t, F(np.tan(np.pi / 8)))
    t = a.apply("select", far, a.apply("div", a.apply("sub", t, F(1)), a.apply("add", t, F(1))), t)
    z = a.apply("mul", t, t)
    angle = a.apply("add", t, a.apply("mul", a.apply("mul", t, z), polynomial(a, z, ARC_TANGENT)))
    angle = a.apply("add", angle, a.apply("select", far, F(np.pi / 4), F(0)))
    angle = a.apply("select", steep, a.apply("sub", F(np.pi / 2), angle), angle)
    angle = a.apply("select", a.apply("lt", x, F(0)), a.apply("sub", F(np.pi), angle), angle)
    return a.apply("select", a.apply("lt", y, F(0)), a.apply("neg", angle), angle)


def power(a: Algebra, x: Number, exponent: int) -> Number:
    """Return a small integer power."""
    if abs(exponent) > LARGEST_POWER:
        raise Unsupported(f"a power of {exponent}")
    value: Number = x.dtype.type(1)
    for _ in range(abs(exponent)):
        value = a.apply("mul", value, x)
    return value if exponent >= 0 else a.apply("div", x.dtype.type(1), value)


def _pow(a: Algebra, x: Number, y: Number) -> Number:
    """Return x to the y."""
    if is_known(y) and y == np.trunc(y) and abs(y) <= LARGEST_POWER:
        return power(a, x, int(y))
    return exponentials.power(a, x, a.cast(y, np.float32))


def _sign(a: Algebra, x: Number) -> Number:
    """Return -1, 0 or 1."""
    zero, one = x.dtype.type(0), x.dtype.type(1)
    below = a.apply("select", a.apply("lt", x, zero), -one, zero)
    return a.apply("select", a.apply("gt", x, zero), one, below)


ELEMENTARY: Final[dict[str, Callable[..., Number]]] = {
    "atan2": _atan2,
    "cos": partial(_circular, 1),
    "exp": exponentials.exp,
    "expm1": exponentials.expm1,
    "is_finite": lambda a, x: a.apply("lt", a.apply("abs", x), x.dtype.type(np.inf)),
    "log": exponentials.log,
    "log1p": exponentials.log1p,
    "logistic": exponentials.logistic,
    "pow": _pow,
    "rsqrt": lambda a, x: a.apply("div", x.dtype.type(1), a.apply("sqrt", x)),
    "sign": _sign,
    "sin": partial(_circular, 0),
    "square": lambda a, x: a.apply("mul", x, x),
    "tanh": exponentials.tanh,
}
"""By jax's names; each function takes the algebra and the operands."""
