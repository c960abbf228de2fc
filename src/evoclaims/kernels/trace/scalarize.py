"""A function's jaxpr as scalar expressions: one for every number in every array.

Moving numbers (slices, transpositions, indexing) costs nothing, and known values are computed while tracing.

What depends on `seldom` conditions is written once more, with False for them: what they switch on is 0 and vanishes,
with all that is needed for it alone. Roundings stay the same, since it has been decided which products are fused with
sums. What the short way shares with the whole one is computed before.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from functools import partial, reduce

import numpy as np
from jax.extend.core import ClosedJaxpr

from evoclaims.kernels.trace import (
    arithmetic,  # noqa: F401  (they register what primitives do)
    indexing,  # noqa: F401  (they register what primitives do)
)
from evoclaims.kernels.trace.algebra import Algebra
from evoclaims.kernels.trace.expressions import (
    Carried,
    Choice,
    Chosen,
    Expression,
    Input,
    Loop,
    LoopResult,
    Number,
    ScalarOperation,
    everything,
    in_order,
    is_known,
    loop,
    operands_of,
)
from evoclaims.kernels.trace.interpreter import Numbers, Scalars, check, listed


def with_shortcut(results: Sequence[Number], mirrors: bool = False) -> list[Number]:
    """Return a round's results, chosen between both ways.

    They are unchanged if there is no `seldom` condition, or if a loop inside depends on one.
    """
    order = in_order(results)
    guards = [e for e in order if isinstance(e, ScalarOperation) and e.name == "seldom"]
    if not guards:
        return list(results)
    algebra = Algebra(mirrors)
    new: dict[int, Number] = {id(guard): np.bool_(False) for guard in guards}
    for expression in order:
        if id(expression) not in new and any(id(p) in new for p in operands_of(expression)):
            if not isinstance(expression, ScalarOperation):
                return list(results)
            operands = [new.get(id(o), o) for o in expression.operands]
            new[id(expression)] = algebra.again(expression, operands)
    # Where all guards are False, each is also without what earlier ones switch on. Where some are not, the first is.
    conditions = [new.get(id(guard.operands[0]), guard.operands[0]) for guard in guards]
    condition: Number = reduce(partial(algebra.apply, "or"), conditions)
    if is_known(condition):
        return list(results)
    short = tuple(new.get(id(result), result) for result in results)
    taken = _shared(condition, results, short, set(map(id, order)))
    choice = Choice(condition, tuple(results), short, taken)
    return [Chosen(result.dtype, choice, place) for place, result in enumerate(results)]


def _shared(
    condition: Expression, whole: Sequence[Number], short: Sequence[Number], old: set[int]
) -> tuple[Expression, ...]:
    """Return what both ways use of what is computed before: the condition, and what is `old` in the short way."""
    before = {id(e) for e in in_order(short) if id(e) in old} | {id(e) for e in in_order([condition])}
    used = [n for n in (*whole, *short) if not is_known(n)]
    used += [p for way in (whole, short) for e in in_order(way) if id(e) not in before for p in operands_of(e)]
    shared = {id(e): e for e in used if id(e) in before and not isinstance(e, (Carried, Input))}
    return tuple(shared.values())


def fused(results: Sequence[Number], mirrors: bool = False) -> list[Number]:
    """Return numbers with the products of floats that are used once, in a sum or difference, fused with it."""
    return _Fusing(_products(results), mirrors).of(results)


class _Fusing:
    """Writes expressions anew, with fused products."""

    def __init__(self, products: frozenset[int], mirrors: bool) -> None:
        """Begin; `products` are the ids of those that are fused."""
        self._products = products
        self._mirrors = mirrors
        self._new: dict[int, Number] = {}
        self._loops: dict[int, Loop] = {}

    def of(self, numbers: Sequence[Number]) -> list[Number]:
        """Return numbers as they are written anew."""
        for expression in in_order(numbers):
            if id(expression) not in self._new:
                self._new[id(expression)] = self._written(expression)
        return [self._new.get(id(n), n) for n in numbers]

    def _written(self, expression: Expression) -> Number:
        """Return an expression whose operands have been written."""
        if isinstance(expression, LoopResult):
            return LoopResult(expression.dtype, self._repeated(expression.loop), expression.place)
        if not isinstance(expression, ScalarOperation):
            return expression
        name, operands = expression.name, expression.operands
        product = next((o for o in reversed(operands) if id(o) in self._products), None)
        if name in ("add", "sub") and product is not None:
            other = operands[0] if product is operands[1] else operands[1]
            name = "fma" if name == "add" else "fnma" if product is operands[1] else "fms"
            operands = (other, *product.operands)
        return ScalarOperation(expression.dtype, name, tuple(self._new.get(id(o), o) for o in operands))

    def _repeated(self, around: Loop) -> Loop:
        """Return a loop."""
        if id(around) not in self._loops:
            start, results = self.of(around.start), with_shortcut(self.of(around.results), self._mirrors)
            self._loops[id(around)] = loop(around.rounds, around.carried, start, results)
        return self._loops[id(around)]


def _products(results: Sequence[Number]) -> frozenset[int]:
    """Return the ids of the products of floats that are used once, in a sum or difference."""
    expressions = everything(results)
    uses: Counter[int] = Counter(id(r) for r in results)
    for expression in expressions:
        match expression:
            case ScalarOperation(operands=operands):
                uses.update(map(id, operands))
            case LoopResult(loop=around):
                uses.update(map(id, (*around.start, *around.results, *around.taken)))
    chosen = set()
    for expression in expressions:
        if isinstance(expression, ScalarOperation) and expression.name in ("add", "sub"):
            for operand in reversed(expression.operands):
                product = isinstance(operand, ScalarOperation) and operand.name == "mul" and operand.dtype.kind == "f"
                if product and uses[id(operand)] == 1:
                    chosen.add(id(operand))
                    break
    return frozenset(chosen)


@np.errstate(all="ignore")
def scalarize(traced: ClosedJaxpr, mirrors: bool = False) -> list[Numbers]:
    """Return the expressions of every result of a traced function.

    Args:
        traced: of small arrays; its i-th argument is array i of `Input`.
        mirrors: see `Algebra`. Numbers may be rounded otherwise then, since other products are used once.

    Raises:
        Unsupported: for a primitive, a use of one, or a dtype without a scalar expression here.
    """
    for aval in traced.out_avals:
        check(aval.dtype)
    inputs = [
        listed([Input(check(aval.dtype), array, place) for place in range(math.prod(aval.shape))], aval.shape)
        for array, aval in enumerate(traced.in_avals)
    ]
    results = Scalars(mirrors).run(traced, inputs)
    numbers = iter(fused([number for result in results for number in result.flat], mirrors))
    return [listed([next(numbers) for _ in result.flat], result.shape) for result in results]
