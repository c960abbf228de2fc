"""Products that are rounded together with a sum: chosen once, for every machine, so that bits do not depend on it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from evoclaims.kernels.trace.expressions import (
    Expression,
    Loop,
    LoopResult,
    Number,
    ScalarOperation,
    everything,
    in_order,
    loop,
)
from evoclaims.kernels.trace.shortcuts import with_shortcut


def fused(results: Sequence[Number]) -> list[Number]:
    """Return numbers with the products of floats that are used once, in a sum or difference, fused with it."""
    return _Fusing(_products(results)).of(results)


class _Fusing:
    """Writes expressions anew, with fused products."""

    def __init__(self, products: frozenset[int]) -> None:
        """Begin; `products` are the ids of those that are fused."""
        self._products = products
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
            start, results = self.of(around.start), with_shortcut(self.of(around.results))
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
