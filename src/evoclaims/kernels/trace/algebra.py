"""Making expressions: constants are folded, equal expressions shared, and operations without effect dropped."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from evoclaims.kernels.trace.expressions import (
    COMPARISONS,
    FUSED,
    KNOWN,
    Expression,
    Number,
    ScalarOperation,
    Unsupported,
    is_known,
)

Rule = Callable[..., Number | None]
COMMUTATIVE: Final = frozenset({"add", "and", "eq", "max", "min", "mul", "ne", "or", "xor"})
ALONE: Final = {**KNOWN, "add": operator.add, "mul": operator.mul, "sub": operator.sub}
"""`KNOWN` for single numbers, of which operators are a few times as fast as NumPy's functions."""


class Algebra:
    """Makes expressions, and remembers those it has made."""

    def __init__(self, mirrors: bool = False) -> None:
        """Start empty.

        Args:
            mirrors: whether signs are moved outwards, so that what differs by signs alone becomes alike.
        """
        self._made: dict[tuple[Any, ...], ScalarOperation] = {}
        self._mirrors = mirrors

    def apply(self, name: str, *operands: Number) -> Number:
        """Return an operation on numbers of one dtype (except the condition of "select").

        NaN, infinity and the sign of 0 may be ignored, as in some compilers: 0 * x, 0 / x and x - x are all 0. Callers
        ignore NumPy's warnings: most operations of a robot's step are on known numbers, and to do so takes longer.
        """
        for operand in operands:
            if isinstance(operand, Expression):
                break
        else:
            found = ALONE[name](*operands)
            return found if isinstance(found, np.generic) else np.asarray(found)[()]
        rule = RULES.get(name)
        simpler = None if rule is None else rule(self, *operands)
        if simpler is None and self._mirrors and operands[-1].dtype.kind == "f" and name in SIGNED:
            simpler = SIGNED[name](self, *operands)
        if simpler is not None:
            return simpler
        return self._shared(name, operands, np.dtype(bool) if name in COMPARISONS else operands[-1].dtype)

    def again(self, operation: ScalarOperation, operands: Sequence[Number]) -> Number:
        """Return an operation that has been made, on other operands."""
        if operation.name == "cast":
            return self.cast(operands[0], operation.dtype)
        if operation.name == "bits":
            return self.bits(operands[0], operation.dtype)
        if operation.name in FUSED:
            return self._fused(operation.name, *operands)
        return self.apply(operation.name, *operands)

    def _fused(self, name: str, c: Number, a: Number, b: Number) -> Number:
        """Return c + a · b, or what else `FUSED` has, rounded once."""
        product = _mul(self, a, b)  # None unless it is exact
        if product is None and _is(c, 0):
            product = self.apply("mul", a, b)
        if product is None:
            return self._shared(name, (c, a, b), a.dtype)
        if name == "fma":
            return self.apply("add", c, product)
        return self.apply("sub", c, product) if name == "fnma" else self.apply("sub", product, c)

    def cast(self, number: Number, dtype: Any) -> Number:
        """Return the number as another dtype; floats become integers by truncation."""
        dtype = np.dtype(dtype)
        if number.dtype == dtype:
            return number
        if is_known(number):
            return _converted(number, dtype)
        if dtype.kind == "b":
            return self.apply("ne", number, number.dtype.type(0))
        return self._shared("cast", (number,), dtype)

    def bits(self, number: Number, dtype: Any) -> Number:
        """Return the number that has the same bits in another dtype; float32 and int32."""
        dtype = np.dtype(dtype)
        if number.dtype == dtype:
            return number
        return number.view(dtype) if is_known(number) else self._shared("bits", (number,), dtype)

    def turned(self, a: Number, b: Number) -> Number | None:
        """Return a difference, if the one that is its negation has been made."""
        made = self._made.get(self._key("sub", (b, a), b.dtype))
        return None if made is None else self.apply("neg", made)

    def _key(self, name: str, operands: tuple[Number, ...], dtype: np.dtype[Any]) -> tuple[Any, ...]:
        """Return what an operation is known by."""
        keys = [id(o) if isinstance(o, Expression) else (o.dtype.char, o.tobytes()) for o in operands]
        return (name, dtype, frozenset(keys)) if name in COMMUTATIVE else (name, dtype, *keys)

    def _shared(self, name: str, operands: tuple[Number, ...], dtype: np.dtype[Any]) -> ScalarOperation:
        """Return the one object for an operation on these operands."""
        key = self._key(name, operands, dtype)
        made = self._made.get(key)
        if made is None:  # the key has operands' ids; the object keeps them alive
            made = self._made[key] = ScalarOperation(dtype, name, operands)
        return made


def _converted(number: Any, dtype: np.dtype[Any]) -> Any:
    """Return a known number as another dtype; as in XLA, integers do not overflow, and NaN is 0."""
    if dtype.kind == "i" and number.dtype.kind == "f":
        limits = np.iinfo(dtype)
        return dtype.type(0 if np.isnan(number) else int(min(max(float(number), limits.min), limits.max)))
    return dtype.type(number)


def _is(number: Number, value: float) -> bool:
    """Whether a number is known to be `value`."""
    return not isinstance(number, Expression) and bool(number == value)


def _add(algebra: Algebra, a: Number, b: Number) -> Number | None:
    return b if _is(a, 0) else a if _is(b, 0) else None


def _sub(algebra: Algebra, a: Number, b: Number) -> Number | None:
    if _is(b, 0):
        return a
    if a is b:
        return a.dtype.type(0)
    return algebra.apply("neg", b) if _is(a, 0) else None


def _mul(algebra: Algebra, a: Number, b: Number) -> Number | None:
    for x, y in ((a, b), (b, a)):
        if isinstance(x, Expression):
            continue
        if _is(x, 0):
            return x.dtype.type(0)
        if _is(x, 1):
            return y
        if _is(x, -1):
            return algebra.apply("neg", y)
    return None


def _div(algebra: Algebra, a: Number, b: Number) -> Number | None:
    if b.dtype.kind == "i":
        _check_divisor(b)
    if _is(b, 1) or _is(a, 0):
        return a
    if b.dtype.kind == "f" and is_known(b) and abs(math.frexp(float(b))[0]) == 0.5 and abs(b) > 1e-30:
        return algebra.apply("mul", a, b.dtype.type(1) / b)  # the reciprocal of a power of two is exact
    return None


def _rem(algebra: Algebra, a: Number, b: Number) -> Number | None:
    if b.dtype.kind == "f":
        raise Unsupported("a remainder of floats")
    _check_divisor(b)
    return None


def _check_divisor(divisor: Number) -> None:
    """Check that an integer divisor is known not to be 0: GPUs leave that result undefined."""
    if not is_known(divisor) or divisor == 0:
        raise Unsupported("a division by an integer that may be 0")


def _undone(name: str) -> Rule:
    """Return the rule of an operation that undoes itself."""
    return lambda algebra, a: a.operands[0] if isinstance(a, ScalarOperation) and a.name == name else None


def _same(algebra: Algebra, a: Number, b: Number) -> Number | None:
    return a if a is b else None


def _decided(by: bool) -> Rule:
    """Return the rule of "and" or "or": a condition that is known decides, or leaves it to the other one."""

    def rule(algebra: Algebra, a: Number, b: Number) -> Number | None:
        if a.dtype == bool and (is_known(a) or is_known(b)):
            known, other = (a, b) if is_known(a) else (b, a)
            return known if bool(known) is by else other
        return _same(algebra, a, b)

    return rule


def _shift(algebra: Algebra, a: Number, places: Number) -> Number | None:
    if not is_known(places) or not 0 <= places < 32:
        raise Unsupported("a shift by a number of bits that may be too large")
    return None


def _select(algebra: Algebra, condition: Number, yes: Number, no: Number) -> Number | None:
    if is_known(condition):
        return yes if condition else no
    if _same_number(yes, no):
        return yes
    if yes.dtype == bool:  # GPUs have no instruction that selects between conditions
        other = algebra.apply("and", algebra.apply("not", condition), no)
        return algebra.apply("or", algebra.apply("and", condition, yes), other)
    if isinstance(no, ScalarOperation) and no.name == "select" and _same_number(yes, no.operands[1]):
        # Where many numbers are chosen by the same conditions, so are the conditions of equal ones.
        return algebra.apply("select", algebra.apply("or", condition, no.operands[0]), *no.operands[1:])
    return None


def _same_number(a: Number, b: Number) -> bool:
    """Whether two numbers are the same expression, or known to have the same bits."""
    return a is b or (is_known(a) and is_known(b) and a.tobytes() == b.tobytes())


def _unsigned(number: Number) -> tuple[Number, bool]:
    """Return a float without its sign, as far as that is known, and whether it had one."""
    if is_known(number):
        return (-number, True) if number < 0 else (number, False)
    negative = isinstance(number, ScalarOperation) and number.name == "neg"
    return (number.operands[0], True) if negative else (number, False)


def _signed_product(name: str) -> Rule:
    """Return the rule that moves the signs of factors, or of a quotient's numbers, outwards."""

    def rule(algebra: Algebra, a: Number, b: Number) -> Number | None:
        (a, one), (b, other) = _unsigned(a), _unsigned(b)
        if not one and not other:
            return None
        made = algebra.apply(name, a, b)
        return made if one == other else algebra.apply("neg", made)

    return rule


def _signed_sum(algebra: Algebra, a: Number, b: Number) -> Number | None:
    (positive, one), (other_positive, other) = _unsigned(a), _unsigned(b)
    if other and (not one or is_known(a)):
        return algebra.apply("sub", a, other_positive)
    if one and not is_known(a):
        made = algebra.apply("add" if other else "sub", positive, other_positive if other else b)
        return algebra.apply("neg", made)
    return algebra.apply("sub", b, positive) if one else None


def _signed_difference(algebra: Algebra, a: Number, b: Number) -> Number | None:
    (positive, one), (other_positive, other) = _unsigned(a), _unsigned(b)
    if other:
        return algebra.apply("add", a, other_positive)
    if one and not is_known(a):
        return algebra.apply("neg", algebra.apply("add", positive, b))
    return algebra.turned(a, b)


SIGNED: Final[dict[str, Rule]] = {
    "add": _signed_sum,
    "div": _signed_product("div"),
    "mul": _signed_product("mul"),
    "sub": _signed_difference,
}
"""How signs move outwards. Operands keep their order, by which products are fused with sums."""
RULES: Final[dict[str, Rule]] = {
    "add": _add,
    "and": _decided(by=False),
    "div": _div,
    "max": _same,
    "min": _same,
    "mul": _mul,
    "neg": _undone("neg"),
    "not": _undone("not"),
    "or": _decided(by=True),
    "rem": _rem,
    "select": _select,
    "shift_left": _shift,
    "shift_right_arithmetic": _shift,
    "shift_right_logical": _shift,
    "sub": _sub,
}
"""Simplifications by operation: each returns a simpler number, or None without one."""
