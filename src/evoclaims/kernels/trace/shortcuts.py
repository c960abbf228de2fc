"""A second way to compute a loop's round: what is left of it where no `seldom` condition is True.

What depends on such conditions is written once more, with False for them: what they switch on is 0 and vanishes, with
all that is needed for it alone. Roundings stay the same, since it has been decided which products are fused with sums.
What the short way shares with the whole one is computed before.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evoclaims.kernels.trace.algebra import Algebra
from evoclaims.kernels.trace.expressions import (
    Carried,
    Choice,
    Chosen,
    Expression,
    Input,
    Number,
    ScalarOperation,
    in_order,
    is_known,
    operands_of,
)


def with_shortcut(results: Sequence[Number]) -> list[Number]:
    """Return a round's results, chosen between both ways.

    They are unchanged if there is no `seldom` condition, or if a loop inside depends on one.
    """
    order = in_order(results)
    guards = [e for e in order if isinstance(e, ScalarOperation) and e.name == "seldom"]
    algebra = Algebra()
    new: dict[int, Number] = {id(guard): np.bool_(False) for guard in guards}
    for expression in order:
        if id(expression) not in new and any(id(p) in new for p in operands_of(expression)):
            if not isinstance(expression, ScalarOperation):
                return list(results)
            operands = [new.get(id(o), o) for o in expression.operands]
            new[id(expression)] = algebra.again(expression, operands)
    if not guards:
        return list(results)
    condition = guards[0].operands[0]
    for guard in guards[1:]:
        condition = algebra.apply("or", condition, guard.operands[0])
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
