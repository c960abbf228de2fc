"""Evaluates a jaxpr with NumPy, without compiling it, for many inputs at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

import jax
import numpy as np
from jax.extend.core import Literal
from jax.lax import GatherScatterMode
from numpy.typing import NDArray

from evoclaims.kernels.trace.expressions import KNOWN
from evoclaims.kernels.trace.interpreter import CALLS

Lanes = NDArray[Any]
"""An array of the jaxpr for every input: the leading axis counts inputs, and is 1 for what all have in common."""
Rule = Callable[..., Sequence[Lanes]]

ELEMENTARY: Final[dict[str, Callable[..., Any]]] = {
    **{name: function for name, function in KNOWN.items() if isinstance(function, np.ufunc)},
    **{name: getattr(np, name) for name in ("cos", "exp", "log", "pow", "sign", "sin", "square", "tan", "tanh")},
    "acos": np.arccos,
    "asin": np.arcsin,
    "atan": np.arctan,
    "atan2": np.arctan2,
    "copy": np.asarray,
    "is_finite": np.isfinite,
    "rsqrt": lambda x: 1 / np.sqrt(x),
    "seldom": np.asarray,
    "stop_gradient": np.asarray,
}
"""Operations on numbers, by jax's names."""
REDUCTIONS: Final = {
    f"reduce_{name}": KNOWN[{"sum": "add", "prod": "mul"}.get(name, name)]
    for name in ("and", "max", "min", "or", "prod", "sum")
}
WRITES: Final = {"scatter": None, "scatter-add": np.add, "scatter-mul": np.multiply}
RULES: Final[dict[str, Rule]] = {}


def in_numpy(function: Callable[..., Any], *inputs: NDArray[Any]) -> list[Lanes]:
    """Return the leaves of a function's results for every row of its arguments.

    It is for what is computed once: tracing takes as long as for a compiled program, and there is no compiling.
    A primitive without a rule here is compiled by jax, alone.

    Args:
        function: of arrays, in jax.
        inputs: with a leading axis that counts inputs.
    """
    traced = jax.make_jaxpr(function)(*(jax.ShapeDtypeStruct(x.shape[1:], x.dtype) for x in inputs))
    with np.errstate(all="ignore"):  # as jax, both sides of a selection are computed
        return [np.broadcast_to(x, (len(inputs[0]), *x.shape[1:])) for x in _run(traced, inputs)]


def _run(closed: Any, operands: Sequence[Lanes]) -> list[Lanes]:
    """Return the results of a closed jaxpr."""
    jaxpr = closed.jaxpr
    values: dict[Any, Lanes] = dict(zip(jaxpr.constvars, (np.asarray(c)[None] for c in closed.consts), strict=True))
    values.update(zip(jaxpr.invars, operands, strict=True))

    def read(variable: Any) -> Lanes:
        if isinstance(variable, Literal):
            aval: Any = variable.aval
            return np.asarray(variable.val, aval.dtype)[None]
        return values[variable]

    for equation in jaxpr.eqns:
        name, arguments = equation.primitive.name, [read(v) for v in equation.invars]
        if name in CALLS:
            results: Sequence[Lanes] = _run(equation.params[CALLS[name]], arguments)
        elif name in ELEMENTARY:
            function: Any = ELEMENTARY[name]
            results = [function(*_of_one_rank(arguments))]
        else:
            rule: Any = RULES.get(name, _compiled)
            results = rule(equation, *arguments)
        values.update(zip(equation.outvars, results, strict=True))
    return [read(v) for v in jaxpr.outvars]


def _rule(*names: str) -> Callable[[Rule], Rule]:
    def register(rule: Rule) -> Rule:
        RULES.update(dict.fromkeys(names, rule))
        return rule

    return register


def _compiled(equation: Any, *operands: Lanes) -> Sequence[Lanes]:
    """Compute a primitive that has no rule by jax."""
    params = equation.primitive.get_bind_params(equation.params)
    bind = partial(equation.primitive.bind, **params)
    results = jax.jit(jax.vmap(bind))(*_alike(operands)) if operands else jax.tree.map(lambda x: x[None], bind())
    return [np.asarray(x) for x in (results if equation.primitive.multiple_results else [results])]


def _alike(operands: Sequence[Lanes]) -> list[Lanes]:
    """Return operands for equally many inputs."""
    count = max(map(len, operands), default=1)
    return [np.broadcast_to(x, (count, *x.shape[1:])) for x in operands]


def _of_one_rank(operands: Sequence[Lanes]) -> list[Lanes]:
    """Return operands, of which some may be single numbers, with equally many dimensions."""
    most = max(x.ndim for x in operands)
    return [x if x.ndim == most else x.reshape(x.shape + (1,) * (most - x.ndim)) for x in operands]


def _along(row: NDArray[Any], dimension: int, ndim: int) -> NDArray[Any]:
    return row.reshape([-1 if d == dimension else 1 for d in range(-1, ndim)])


@_rule("div")
def _div(equation: Any, a: Lanes, b: Lanes) -> Sequence[Lanes]:
    a, b = _of_one_rank([a, b])
    if a.dtype.kind == "f":
        return [a / b]
    return [np.where(b == 0, -1, (a - np.fmod(a, b)) // np.where(b == 0, 1, b))]  # towards zero


@_rule("rem")
def _rem(equation: Any, a: Lanes, b: Lanes) -> Sequence[Lanes]:
    a, b = _of_one_rank([a, b])
    return [np.fmod(a, b) if a.dtype.kind == "f" else np.where(b == 0, a, np.fmod(a, b))]


@_rule("integer_pow")
def _integer_pow(equation: Any, x: Lanes) -> Sequence[Lanes]:
    y = equation.params["y"]
    return [x**y if y >= 0 else 1 / x**-y]


@_rule("select_n")
def _select_n(equation: Any, which: Lanes, *cases: Lanes) -> Sequence[Lanes]:
    chosen, result, *others = _of_one_rank([which, *cases])
    for number, case in enumerate(others, 1):
        result = np.where(chosen == number, case, result)
    return [result]


@_rule("clamp")
def _clamp(equation: Any, low: Lanes, x: Lanes, high: Lanes) -> Sequence[Lanes]:
    low, x, high = _of_one_rank([low, x, high])
    return [np.minimum(np.maximum(x, low), high)]


@_rule("convert_element_type")
def _convert_element_type(equation: Any, x: Lanes) -> Sequence[Lanes]:
    to = np.dtype(equation.params["new_dtype"])
    return [x.astype(to)] if to.kind != "i" or x.dtype.kind != "f" else _compiled(equation, x)


@_rule("reshape", "squeeze")
def _reshape(equation: Any, x: Lanes) -> Sequence[Lanes]:
    return [x.reshape(len(x), *equation.outvars[0].aval.shape)]


@_rule("broadcast_in_dim")
def _broadcast_in_dim(equation: Any, x: Lanes) -> Sequence[Lanes]:
    shape = equation.outvars[0].aval.shape
    aligned = [1] * len(shape)
    for size, dimension in zip(x.shape[1:], equation.params["broadcast_dimensions"], strict=True):
        aligned[dimension] = size
    return [np.broadcast_to(x.reshape(len(x), *aligned), (len(x), *shape))]


@_rule("transpose")
def _transpose(equation: Any, x: Lanes) -> Sequence[Lanes]:
    return [np.transpose(x, (0, *(d + 1 for d in equation.params["permutation"])))]


@_rule("concatenate")
def _concatenate(equation: Any, *operands: Lanes) -> Sequence[Lanes]:
    return [np.concatenate(_alike(operands), equation.params["dimension"] + 1)]


@_rule("stack")
def _stack(equation: Any, *operands: Lanes) -> Sequence[Lanes]:
    return [np.stack(_alike(operands), equation.params["axis"] + 1)]


@_rule("tile")
def _tile(equation: Any, x: Lanes) -> Sequence[Lanes]:
    return [np.tile(x, (1, *equation.params["reps"]))]


@_rule("pad")
def _pad(equation: Any, x: Lanes, padding: Lanes) -> Sequence[Lanes]:
    widths = equation.params["padding_config"]
    if any(low < 0 or high < 0 for low, high, _ in widths):
        return _compiled(equation, x, padding)
    x, padding = _alike([x, padding])
    result = np.empty((len(x), *equation.outvars[0].aval.shape), x.dtype)
    result[...] = padding.reshape(-1, *[1] * (x.ndim - 1))
    result[
        (
            slice(None),
            *(
                slice(low, size - high, between + 1)
                for size, (low, high, between) in zip(result.shape[1:], widths, strict=True)
            ),
        )
    ] = x
    return [result]


@_rule("slice")
def _slice(equation: Any, x: Lanes) -> Sequence[Lanes]:
    p = equation.params
    steps = p["strides"] or (1,) * (x.ndim - 1)
    return [x[(slice(None), *map(slice, p["start_indices"], p["limit_indices"], steps))]]


@_rule("iota")
def _iota(equation: Any) -> Sequence[Lanes]:
    aval, dimension = equation.outvars[0].aval, equation.params["dimension"]
    row = _along(np.arange(aval.shape[dimension], dtype=aval.dtype), dimension, len(aval.shape))
    return [np.broadcast_to(row, (1, *aval.shape))]


@_rule(*REDUCTIONS)
def _reduce(equation: Any, x: Lanes) -> Sequence[Lanes]:
    axes = tuple(axis + 1 for axis in equation.params["axes"])
    combine: Any = REDUCTIONS[equation.primitive.name]
    if combine.identity is None and not math.prod(x.shape[axis] for axis in axes):
        return _compiled(equation, x)
    return [combine.reduce(x, axis=axes)]


@_rule("argmax", "argmin")
def _argmax(equation: Any, x: Lanes) -> Sequence[Lanes]:
    (axis,) = equation.params["axes"]
    return [getattr(np, equation.primitive.name)(x, axis=axis + 1).astype(equation.outvars[0].aval.dtype)]


@_rule("cumsum")
def _cumsum(equation: Any, x: Lanes) -> Sequence[Lanes]:
    axis, turned = equation.params["axis"] + 1, equation.params["reverse"]
    sums = np.cumsum(np.flip(x, axis) if turned else x, axis, dtype=x.dtype)
    return [np.flip(sums, axis) if turned else sums]


@_rule("sort")
def _sort(equation: Any, *operands: Lanes) -> Sequence[Lanes]:
    if equation.params["num_keys"] != 1:
        return _compiled(equation, *operands)
    axis, alike = equation.params["dimension"] + 1, _alike(operands)
    order = np.argsort(alike[0], axis, kind="stable")
    return [np.take_along_axis(x, order, axis) for x in alike]


@_rule("top_k")
def _top_k(equation: Any, x: Lanes) -> Sequence[Lanes]:
    if equation.params.get("axis", -1) not in (-1, x.ndim - 2) or x.dtype.kind != "f" or np.isnan(x).any():
        return _compiled(equation, x)
    order = np.argsort(-x, -1, kind="stable")[..., : equation.params["k"]]
    return [np.take_along_axis(x, order, -1), order.astype(equation.outvars[1].aval.dtype)]


@_rule("cholesky")
def _cholesky(equation: Any, x: Lanes) -> Sequence[Lanes]:
    try:
        return [np.linalg.cholesky(x)]
    except np.linalg.LinAlgError:  # of one of the inputs, which alone is NaN in jax
        return _compiled(equation, x)


@_rule("triangular_solve")
def _triangular_solve(equation: Any, matrix: Lanes, right: Lanes) -> Sequence[Lanes]:
    p = equation.params
    if not p["left_side"] or p["unit_diagonal"]:
        return _compiled(equation, matrix, right)
    half = np.tril(matrix) if p["lower"] else np.triu(matrix)
    return [np.linalg.solve(np.swapaxes(half, -1, -2) if p["transpose_a"] else half, right)]


@_rule("dot_general")
def _dot_general(equation: Any, left: Lanes, right: Lanes) -> Sequence[Lanes]:
    (of_left, of_right), (batch_left, batch_right) = equation.params["dimension_numbers"]
    names_left = [f"{chr(97 + d)}" for d in range(left.ndim - 1)]
    names_right = [f"{chr(65 + d)}" for d in range(right.ndim - 1)]
    for d, e in zip((*of_left, *batch_left), (*of_right, *batch_right), strict=True):
        names_right[e] = names_left[d]
    free = [names_left[d] for d in range(left.ndim - 1) if d not in (*of_left, *batch_left)]
    free += [names_right[d] for d in range(right.ndim - 1) if d not in (*of_right, *batch_right)]
    result = "".join([*(names_left[d] for d in batch_left), *free])
    text = f"...{''.join(names_left)},...{''.join(names_right)}->...{result}"
    return [np.einsum(text, left, right).astype(equation.outvars[0].aval.dtype)]


@_rule("scan")
def _scan(equation: Any, *operands: Lanes) -> Sequence[Lanes]:
    p = equation.params
    inner = p["jaxpr"].jaxpr
    # What jax calls these counts differs by release: rows and results by rows have one dimension more outside.
    known = sum(a.aval.ndim == b.aval.ndim for a, b in zip(equation.invars, inner.invars, strict=True))
    carries = sum(a.aval.ndim == b.aval.ndim for a, b in zip(equation.outvars, inner.outvars, strict=True))
    fixed, carry = list(operands[: known - carries]), list(operands[known - carries : known])
    rows, stacked = operands[known:], []
    for i in reversed(range(p["length"])) if p["reverse"] else range(p["length"]):
        results = _run(p["jaxpr"], [*fixed, *carry, *(x[:, i] for x in rows)])
        carry = results[:carries]
        stacked.append(results[carries:])
    if not stacked:
        return _compiled(equation, *operands)
    order = stacked[::-1] if p["reverse"] else stacked
    return [*carry, *(np.stack(_alike(column), 1) for column in zip(*order, strict=True))]


@_rule("gather")
def _gather(equation: Any, x: Lanes, indices: Lanes) -> Sequence[Lanes]:
    p, aval = equation.params, equation.outvars[0].aval
    numbers, sizes, ndim = p["dimension_numbers"], p["slice_sizes"], len(aval.shape)
    batch = [d for d in range(ndim) if d not in numbers.offset_dims]
    dropped = (*numbers.collapsed_slice_dims, *numbers.operand_batching_dims)
    window = [d for d in range(x.ndim - 1) if d not in dropped]
    places: list[Any] = [np.zeros((1,) * (ndim + 1), int)] * (x.ndim - 1)
    for d, offset in zip(window, numbers.offset_dims, strict=True):
        places[d] = _along(np.arange(sizes[d]), offset, ndim)
    for d, row in zip(numbers.operand_batching_dims, numbers.start_indices_batching_dims, strict=True):
        places[d] = _along(np.arange(x.shape[d + 1]), batch[row], ndim)
    spread = [aval.shape[d] if d in batch else 1 for d in range(ndim)]
    starts = [(d, indices[..., k].reshape(-1, *spread)) for k, d in enumerate(numbers.start_index_map)]
    inside = _moved(places, starts, [x.shape[d + 1] - sizes[d] for d in range(x.ndim - 1)])
    lane = _along(np.arange(len(x)), -1, ndim)
    result = x[(lane, *places)] if places else x
    count = max(len(x), len(indices))
    if p["mode"] == GatherScatterMode.FILL_OR_DROP and not inside.all():
        if p["fill_value"] is None and aval.dtype.kind not in "f":
            return _compiled(equation, x, indices)
        result = np.where(inside, result, np.nan if p["fill_value"] is None else p["fill_value"]).astype(aval.dtype)
    return [np.broadcast_to(result, (count, *aval.shape))]


def _moved(places: list[Any], starts: Sequence[tuple[int, Lanes]], last: Sequence[int]) -> NDArray[np.bool_]:
    """Move windows' places to where they start, in bounds, and return which starts were in bounds."""
    inside = np.ones((1,) * places[0].ndim if places else (), bool)
    for d, start in starts:
        places[d] = places[d] + np.clip(start, 0, last[d])
        inside = inside & (start >= 0) & (start <= last[d])
    return inside


@_rule(*WRITES)
def _scatter(equation: Any, x: Lanes, indices: Lanes, updates: Lanes) -> Sequence[Lanes]:
    p, ndim = equation.params, updates.ndim - 1
    combine, numbers = WRITES[equation.primitive.name], p["dimension_numbers"]
    if combine is None and p["update_jaxpr"] is not None:
        return _compiled(equation, x, indices, updates)
    x, indices, updates = _alike([x, indices, updates])
    batch = [d for d in range(ndim) if d not in numbers.update_window_dims]
    dropped = (*numbers.inserted_window_dims, *numbers.operand_batching_dims)
    window = [d for d in range(x.ndim - 1) if d not in dropped]
    places: list[Any] = [np.zeros((1,) * (ndim + 1), int)] * (x.ndim - 1)
    last = [size - 1 for size in x.shape[1:]]
    for d, of_update in zip(window, numbers.update_window_dims, strict=True):
        places[d] = _along(np.arange(updates.shape[of_update + 1]), of_update, ndim)
        last[d] = x.shape[d + 1] - updates.shape[of_update + 1]
    for d, row in zip(numbers.operand_batching_dims, numbers.scatter_indices_batching_dims, strict=True):
        places[d] = _along(np.arange(x.shape[d + 1]), batch[row], ndim)
    spread = [updates.shape[d + 1] if d in batch else 1 for d in range(ndim)]
    starts = [(d, indices[..., k].reshape(-1, *spread)) for k, d in enumerate(numbers.scatter_dims_to_operand_dims)]
    inside = _moved(places, starts, last)
    if p["mode"] != GatherScatterMode.FILL_OR_DROP:
        inside = np.ones_like(inside)
    lane = _along(np.arange(len(x)), -1, ndim)
    written = np.broadcast_to(inside, updates.shape)
    at = tuple(np.broadcast_to(place, updates.shape)[written] for place in (lane, *places))
    result = x.copy()
    if combine is None:
        result[at] = updates[written]
    else:
        combine.at(result, at, updates[written])
    return [result]
