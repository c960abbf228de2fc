"""Scalar expressions: what a function computes, number by number.

A number is known (a NumPy scalar) or an expression of inputs. Equal operations on the same operands are one object.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

Number = Any
"""A NumPy scalar, or an `Expression`."""


@dataclass(frozen=True, eq=False, slots=True)
class Expression:
    """A number that is not known yet.

    Attributes:
        dtype: float32, int32 or bool.
    """

    dtype: np.dtype[Any]


@dataclass(frozen=True, eq=False, slots=True)
class Input(Expression):
    """A number of one of the function's input arrays: `array` is its index, `place` the position in the flat array."""

    array: int
    place: int


@dataclass(frozen=True, eq=False, slots=True)
class ScalarOperation(Expression):
    """A simple operation on numbers: one of `KNOWN`, of `FUSED`, "cast", or "bits" (see `Algebra`)."""

    name: str
    operands: tuple[Number, ...]


@dataclass(frozen=True, eq=False, slots=True)
class Carried(Expression):
    """A number that a loop carries from one round to the next."""


@dataclass(frozen=True, eq=False, slots=True)
class Loop:
    """A fixed number of rounds.

    Attributes:
        rounds: how many.
        carried: the carry at the start of a round.
        start: the first carry.
        results: the next carry.
        taken: outside expressions that the rounds use; computed once before the loop, and visible to a loop around
            this one.
    """

    rounds: int
    carried: tuple[Carried, ...]
    start: tuple[Number, ...]
    results: tuple[Number, ...]
    taken: tuple[Expression, ...]

    @property
    def choice(self) -> Choice | None:
        """The choice that all results are of (`with_shortcut`), if there is one."""
        first = self.results[0]
        return first.choice if isinstance(first, Chosen) else None


@dataclass(frozen=True, eq=False, slots=True)
class LoopResult(Expression):
    """A result of a loop: the value at position `place` of the carry after the last round."""

    loop: Loop
    place: int


@dataclass(frozen=True, eq=False, slots=True)
class Choice:
    """Two ways to compute the same numbers.

    Attributes:
        condition: where it is False for all elements that are computed together, the short way will do.
        whole: the results, computed the long way.
        short: the results, computed the short way.
        taken: outside expressions that the ways use; computed before.
    """

    condition: Expression
    whole: tuple[Number, ...]
    short: tuple[Number, ...]
    taken: tuple[Expression, ...]


@dataclass(frozen=True, eq=False, slots=True)
class Chosen(Expression):
    """A result of a choice: the one at position `place`."""

    choice: Choice
    place: int


def is_known(number: Number) -> bool:
    """Whether it is a number, not an expression."""
    return not isinstance(number, Expression)


def loop(rounds: int, carried: Sequence[Carried], start: Sequence[Number], results: Sequence[Number]) -> Loop:
    """Return a loop."""
    inside: set[int] = {id(c) for c in carried}
    taken: dict[int, Expression] = {}
    for expression in in_order(results, with_ways):
        read = with_ways(expression)
        if any(id(p) in inside for p in read):
            inside.add(id(expression))
            taken.update((id(p), p) for p in read if id(p) not in inside)
    taken.update((id(r), r) for r in results if not is_known(r) and id(r) not in inside)
    return Loop(rounds, tuple(carried), tuple(start), tuple(results), tuple(taken.values()))


def operands_of(expression: Expression) -> list[Expression]:
    """Return the expressions that it reads."""
    if isinstance(expression, ScalarOperation):  # nearly all are, and a robot's step has a hundred thousand
        return [o for o in expression.operands if isinstance(o, Expression)]
    if isinstance(expression, LoopResult):
        return [*(s for s in expression.loop.start if not is_known(s)), *expression.loop.taken]
    if isinstance(expression, Chosen):
        return [expression.choice.condition, *expression.choice.taken]
    return []


def with_ways(expression: Expression) -> list[Expression]:
    """Return the expressions that it reads, and the results of both ways of a choice."""
    read = operands_of(expression)
    if isinstance(expression, Chosen):
        read += [n for n in (*expression.choice.whole, *expression.choice.short) if not is_known(n)]
    return read


def in_order(
    numbers: Iterable[Number], operands: Callable[[Expression], list[Expression]] = operands_of
) -> list[Expression]:
    """Return these and all expressions they use, operands first; without the bodies of loops and the ways of choices.

    Args:
        numbers: where to begin.
        operands: what an expression uses.
    """
    begun: set[int] = set()
    order: list[Expression] = []
    for number in numbers:
        if is_known(number) or id(number) in begun:
            continue
        begun.add(id(number))
        path = [(number, iter(operands(number)))]
        while path:
            expression, rest = path[-1]
            for operand in rest:
                if id(operand) not in begun:
                    begun.add(id(operand))
                    path.append((operand, iter(operands(operand))))
                    break
            else:
                order.append(expression)
                path.pop()
    return order


def everything(numbers: Iterable[Number]) -> list[Expression]:
    """Return these and all they use, operands first, also in the ways of choices; the bodies of loops at the end."""
    order = in_order(numbers, with_ways)
    loops = {id(e.loop): e.loop for e in order if isinstance(e, LoopResult)}
    return order + [inner for loop in loops.values() for inner in everything(loop.results)]


def _quotient(a: Any, b: Any) -> Any:
    """Divide; integers round towards zero, and division by 0 is as in XLA."""
    if a.dtype.kind == "f":
        return np.divide(a, b)
    return a.dtype.type(np.trunc(np.divide(a, b, dtype=np.float64))) if b else a.dtype.type(-1)


def _remainder(a: Any, b: Any) -> Any:
    """Return the remainder, with a's sign; for b = 0 it is a, as in XLA."""
    return np.fmod(a, b) if a.dtype.kind == "f" or b else a


KNOWN: Final[dict[str, Callable[..., Any]]] = {
    "abs": np.abs,
    "add": np.add,
    "and": np.bitwise_and,
    "ceil": np.ceil,
    "div": _quotient,
    "eq": np.equal,
    "floor": np.floor,
    "ge": np.greater_equal,
    "gt": np.greater,
    "le": np.less_equal,
    "lt": np.less,
    "max": np.maximum,
    "min": np.minimum,
    "mul": np.multiply,
    "ne": np.not_equal,
    "neg": np.negative,
    "not": np.invert,
    "or": np.bitwise_or,
    "rem": _remainder,
    "rint": np.rint,
    "seldom": np.asarray,
    "select": np.where,
    "shift_left": np.left_shift,
    "shift_right_arithmetic": np.right_shift,
    "shift_right_logical": lambda a, b: (a.view(np.uint32) >> b.view(np.uint32)).view(np.int32),
    "sqrt": np.sqrt,
    "sub": np.subtract,
    "xor": np.bitwise_xor,
}
"""The simple operations, on known numbers. "select" returns its second operand where the first is true; "rint" rounds
halves to even; "seldom" returns its operand (`seldom`); the others are jax's of the same name."""
COMPARISONS: Final = frozenset({"eq", "ge", "gt", "le", "lt", "ne"})
"""Operations that return a bool."""
FUSED: Final = ("fma", "fms", "fnma")
"""Of floats c, a and b, rounded once: c + a · b, a · b - c, and c - a · b."""


class Unsupported(Exception):  # noqa: N818  (not an error: the function runs without a kernel)
    """A function uses something that kernels do not support; the message says what."""
