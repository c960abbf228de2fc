"""Functions made of simple operations: sine, cosine, arc tangent, signs, exponentials, logarithms, powers.

Errors, in units of the result's last place, against float64: exp, log, log1p 2; expm1, logistic, pow 4; tanh 6. Such a
result below 1.2e-38 may be 0. NaN, infinities and signs are NumPy's, but a zero has no sign.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Final

import numpy as np

from evoclaims.kernels.trace.algebra import Algebra
from evoclaims.kernels.trace.expressions import Number, Unsupported, is_known

F, I = np.float32, np.int32
LARGEST_POWER: Final = 16
WIDEST: Final = 50_000.0
"""Largest angle, rad, whose quadrant is found accurately."""
PIO2: Final = (F(1.5703125), F(4.837512969970703125e-4), F(7.549789948768648e-8))
"""π/2 in three parts (Cody and Waite): a small multiple of the first two is exact."""
SINE: Final = (-1.9515295891e-4, 8.3321608736e-3, -1.6666654611e-1)
"""Coefficients of sinf, cosf and atanf in Moshier's Cephes library, highest power first."""
COSINE: Final = (2.443315711809948e-5, -1.388731625493765e-3, 4.166664568298827e-2)
ARC_TANGENT: Final = (8.05374449538e-2, -1.38776856032e-1, 1.99777106478e-1, -3.33329491539e-1)
LN2: Final = (F(0.693359375), F(-2.12194440e-4))
"""ln 2 in two parts: a small multiple of the first is exact."""
SIGNIFICAND: Final = 23
"""Bits of a float32 below its exponent's, which is stored with 127 added."""
INFINITE: Final = F(np.inf).view(np.int32)
ROOT_OF_HALF: Final = F(np.sqrt(0.5)).view(np.int32)
"""Floats above 0 are ordered as their bits are."""
# Highest power first: Moshier's Cephes library (EXP, LOG), Eigen (TANH).
EXP: Final = (1.9875691500e-4, 1.3981999507e-3, 8.3334519073e-3, 4.1665795894e-2, 1.6666665459e-1, 5.0000001201e-1)
LOG: Final = (
    *(7.0376836292e-2, -1.1514610310e-1, 1.1676998740e-1, -1.2420140846e-1, 1.4249322787e-1),
    *(-1.6668057665e-1, 2.0000714765e-1, -2.4999993993e-1, 3.3333331174e-1),
)
TANH: Final = (
    (
        *(-2.76076847742355e-16, 2.00018790482477e-13, -8.60467152213735e-11, 5.12229709037114e-08),
        *(1.48572235717979e-05, 6.37261928875436e-04, 4.89352455891786e-03),
    ),
    (1.19825839466702e-06, 1.18534705686654e-04, 2.26843463243900e-03, 4.89352518554385e-03),
)
WIDEST_TANH: Final = 7.90531110763549805


def polynomial(a: Algebra, z: Number, coefficients: Sequence[float]) -> Number:
    """Evaluate by Horner's rule; coefficients begin with the highest power's."""
    value: Number = F(coefficients[0])
    for coefficient in coefficients[1:]:
        value = a.apply("add", a.apply("mul", value, z), F(coefficient))
    return value


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
    return _any_power(a, x, a.cast(y, np.float32))


def _sign(a: Algebra, x: Number) -> Number:
    """Return -1, 0 or 1."""
    zero, one = x.dtype.type(0), x.dtype.type(1)
    below = a.apply("select", a.apply("lt", x, zero), -one, zero)
    return a.apply("select", a.apply("gt", x, zero), one, below)


def _exp(a: Algebra, x: Number) -> Number:
    """Return e to the x."""
    x = _clamped(a, x, -104.0, 89.0)
    n, rest = _divided(a, x)
    return _scaled(a, a.apply("add", _exp_less_1(a, rest), F(1)), n)


def _expm1(a: Algebra, x: Number) -> Number:
    """Return e to the x, less 1; exact near 0."""
    tiny = a.apply("lt", a.apply("abs", x), F(1e-10))
    n, rest = _divided(a, _clamped(a, x, -20.0, 89.0))
    less_1 = _exp_less_1(a, rest)
    half = _power_of_2(a, a.apply("sub", a.cast(n, I), I(1)))  # half of 2 to the n, which may be infinite
    value = a.apply("add", a.apply("mul", half, less_1), a.apply("sub", half, F(0.5)))
    return a.apply("select", tiny, x, a.apply("mul", value, F(2)))


def _log(a: Algebra, x: Number) -> Number:
    """Return the natural logarithm."""
    e, f = _split(a, x)
    z = a.apply("mul", f, f)
    value = a.apply("mul", a.apply("mul", z, f), polynomial(a, f, LOG))
    value = a.apply("add", value, a.apply("mul", e, LN2[1]))
    value = a.apply("sub", value, a.apply("mul", z, F(0.5)))
    value = a.apply("add", a.apply("add", f, value), a.apply("mul", e, LN2[0]))
    return _logarithm(a, x, value)


def _log1p(a: Algebra, x: Number) -> Number:
    """Return the natural logarithm of 1 + x; exact near 0."""
    whole = a.apply("add", x, F(1))
    lost = a.apply("sub", x, a.apply("sub", whole, F(1)))
    value = _log(a, whole)
    corrected = a.apply("add", value, a.apply("div", lost, whole))
    return a.apply("select", a.apply("lt", a.apply("abs", value), F(np.inf)), corrected, value)


def _logistic(a: Algebra, x: Number) -> Number:
    """Return 1 / (1 + exp(-x))."""
    return a.apply("div", F(1), a.apply("add", _exp(a, a.apply("neg", x)), F(1)))


def _tanh(a: Algebra, x: Number) -> Number:
    """Return the hyperbolic tangent."""
    small = a.apply("lt", a.apply("abs", x), F(0.0004))
    return a.apply("select", small, x, _odd_quotient(a, _clamped(a, x, -WIDEST_TANH, WIDEST_TANH), *TANH))


def _any_power(a: Algebra, x: Number, y: Number) -> Number:
    """Return x to the y.

    Its base-2 logarithm is computed to about 32 bits, as a sum of two numbers, for an exact exponent.
    """
    size = a.apply("abs", x)
    high, low = _log2(a, size)
    short = _leading(a, y)
    exponent = a.apply("mul", short, high)  # exact: both have 12 bits at most
    rest = a.apply("add", a.apply("mul", a.apply("sub", y, short), high), a.apply("mul", y, low))
    n = a.apply("rint", _clamped(a, a.apply("add", exponent, rest), -151.0, 129.0))
    fraction = _clamped(a, a.apply("add", a.apply("sub", exponent, n), rest), -1.0, 1.0)
    value = _scaled(a, _exp2_near_0(a, fraction), n)
    whole = a.apply("eq", a.apply("floor", y), y)
    half = a.apply("mul", y, F(0.5))
    odd = a.apply("and", whole, a.apply("ne", a.apply("floor", half), half))
    # Ends: 0 or infinite bases or exponents.
    grows = a.apply("eq", a.apply("gt", size, F(1)), a.apply("gt", y, F(0)))
    at_end = a.apply("or", a.apply("eq", size, F(0)), a.apply("eq", size, F(np.inf)))
    at_end = a.apply("or", at_end, a.apply("eq", a.apply("abs", y), F(np.inf)))
    value = a.apply("select", at_end, a.apply("select", grows, F(np.inf), F(0)), value)
    below = a.apply("lt", x, F(0))
    value = a.apply("select", a.apply("and", below, odd), a.apply("neg", value), value)
    defined = a.apply("or", whole, a.apply("or", a.apply("ge", x, F(0)), at_end))
    known = a.apply("and", a.apply("eq", x, x), a.apply("eq", y, y))
    value = a.apply("select", a.apply("and", defined, known), value, F(np.nan))
    one = a.apply("or", a.apply("eq", x, F(1)), a.apply("eq", y, F(0)))
    minus_one = a.apply("and", a.apply("eq", x, F(-1)), a.apply("eq", a.apply("abs", y), F(np.inf)))
    return a.apply("select", a.apply("or", one, minus_one), F(1), value)


def _clamped(a: Algebra, x: Number, low: float, high: float) -> Number:
    """Return the nearest number from `low` to `high`; NaN stays."""
    return a.apply("min", a.apply("max", x, F(low)), F(high))


def _divided(a: Algebra, x: Number) -> tuple[Number, Number]:
    """Return n and r of x = n ln 2 + r, n whole and |r| at most about half of ln 2."""
    n = a.apply("rint", a.apply("mul", x, F(1 / np.log(2))))
    for part in LN2:
        x = a.apply("sub", x, a.apply("mul", n, part))
    return n, x


def _exp_less_1(a: Algebra, r: Number) -> Number:
    """Return exp(r) - 1 for |r| < 0.35."""
    return a.apply("add", a.apply("mul", a.apply("mul", r, r), polynomial(a, r, EXP)), r)


def _exp2_near_0(a: Algebra, x: Number) -> Number:
    """Return 2 to the x for |x| at most about a half."""
    return a.apply("add", _exp_less_1(a, a.apply("mul", x, F(np.log(2)))), F(1))


def _power_of_2(a: Algebra, n: Number) -> Number:
    """Return 2 to the n, an integer from -126 to 127."""
    return a.bits(a.apply("shift_left", a.apply("add", n, I(127)), I(SIGNIFICAND)), F)


def _scaled(a: Algebra, x: Number, n: Number) -> Number:
    """Return x times 2 to the n, a whole float; in two steps, for 2 to the n may be out of range."""
    n = a.cast(n, I)
    half = a.apply("shift_right_arithmetic", n, I(1))
    once = a.apply("mul", x, _power_of_2(a, half))
    return a.apply("mul", once, _power_of_2(a, a.apply("sub", n, half)))


def _split(a: Algebra, x: Number) -> tuple[Number, Number]:
    """Return e and f of x = (1 + f) 2^e, with 1 + f from √½ to √2; x is above 0 and finite."""
    bits = a.bits(x, I)
    tiny = a.apply("lt", bits, I(1 << SIGNIFICAND))  # its bits are its multiple of 2^-149
    bits = a.apply("select", tiny, a.bits(a.cast(bits, F), I), bits)
    e = a.apply("shift_right_arithmetic", a.apply("sub", bits, ROOT_OF_HALF), I(SIGNIFICAND))
    m = a.bits(a.apply("sub", bits, a.apply("shift_left", e, I(SIGNIFICAND))), F)
    e = a.apply("add", e, a.apply("select", tiny, I(-149), I(0)))
    return a.cast(e, F), a.apply("sub", m, F(1))


def _logarithm(a: Algebra, x: Number, value: Number) -> Number:
    """Return a logarithm's value, or what it is at 0, below, and at the infinities."""
    bits = a.bits(x, I)
    value = a.apply("select", a.apply("eq", bits, INFINITE), F(np.inf), value)
    outside = a.apply("or", a.apply("lt", bits, I(0)), a.apply("gt", bits, INFINITE))
    value = a.apply("select", outside, F(np.nan), value)
    zero = a.apply("eq", a.apply("shift_left", bits, I(1)), I(0))
    return a.apply("select", zero, F(-np.inf), value)


def _leading(a: Algebra, x: Number) -> Number:
    """Return x without the last 12 of its 24 bits."""
    return a.bits(a.apply("and", a.bits(x, I), I(-(1 << 12))), F)


def _log2(a: Algebra, x: Number) -> tuple[Number, Number]:
    """Return the logarithm to base 2 of a finite number above 0, as the sum of one of 12 bits and a small one."""
    e, f = _split(a, x)
    # The logarithm of (1 + s) / (1 - s) is 2 (s + s³/3 + s⁵/5 + …); s = f / (2 + f) in two parts.
    whole = a.apply("add", f, F(2))
    lost = a.apply("sub", f, a.apply("sub", whole, F(2)))
    s = _leading(a, a.apply("div", f, whole))
    first = _leading(a, whole)
    second = a.apply("add", a.apply("sub", whole, first), lost)
    left = a.apply("sub", a.apply("sub", f, a.apply("mul", s, first)), a.apply("mul", s, second))
    s_low = a.apply("div", left, whole)
    both = a.apply("add", s, s_low)
    z = a.apply("mul", both, both)
    series = polynomial(a, z, (1 / 11, 1 / 9, 1 / 7, 1 / 5, 1 / 3))
    tail = a.apply("add", s_low, a.apply("mul", a.apply("mul", both, z), series))
    # 2 / ln 2 in two parts, the first of 12 bits: its product with s is exact.
    factor = 2 / np.log(2)
    factor_high = _leading(a, F(factor))
    factor_low = F(factor - float(factor_high))
    large = a.apply("mul", s, factor_high)
    small = a.apply("add", a.apply("mul", s, factor_low), a.apply("mul", tail, F(factor)))
    total = a.apply("add", a.apply("add", e, large), small)
    high = _leading(a, total)
    low = a.apply("add", a.apply("add", a.apply("sub", e, high), large), small)
    return high, low


def _odd_quotient(a: Algebra, x: Number, above: Sequence[float], below: Sequence[float]) -> Number:
    """Return x · above(x²) / below(x²), both polynomials."""
    z = a.apply("mul", x, x)
    return a.apply("mul", x, a.apply("div", polynomial(a, z, above), polynomial(a, z, below)))


ELEMENTARY: Final[dict[str, Callable[..., Number]]] = {
    "atan2": _atan2,
    "cos": partial(_circular, 1),
    "exp": _exp,
    "expm1": _expm1,
    "is_finite": lambda a, x: a.apply("lt", a.apply("abs", x), x.dtype.type(np.inf)),
    "log": _log,
    "log1p": _log1p,
    "logistic": _logistic,
    "pow": _pow,
    "rsqrt": lambda a, x: a.apply("div", x.dtype.type(1), a.apply("sqrt", x)),
    "sign": _sign,
    "sin": partial(_circular, 0),
    "square": lambda a, x: a.apply("mul", x, x),
    "tanh": _tanh,
}
"""By jax's names; each function takes the algebra and the operands."""
