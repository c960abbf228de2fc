"""Primitives that index, reshape and sort; the positions they read may be computed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jax.lax import GatherScatterMode

from evoclaims.kernels.trace.expressions import Number, Unsupported, is_known
from evoclaims.kernels.trace.interpreter import Numbers, Scalars, filled, known, listed, primitive

Place = tuple[int, Number, int]
"""A dimension, a window's start position along it, and the last possible start."""


@primitive("copy", "stop_gradient", "optimization_barrier", "pvary")
def _as_it_is(s: Scalars, equation: Any, *operands: Numbers) -> Sequence[Numbers]:
    return operands


@primitive("reshape", "squeeze")
def _reshape(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    return [x.reshape(equation.outvars[0].aval.shape)]


@primitive("broadcast_in_dim")
def _broadcast_in_dim(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    shape = equation.outvars[0].aval.shape
    aligned = [1] * len(shape)
    for size, dimension in zip(x.shape, equation.params["broadcast_dimensions"], strict=True):
        aligned[dimension] = size
    return [np.broadcast_to(x.reshape(aligned), shape)]


@primitive("transpose")
def _transpose(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    return [np.transpose(x, equation.params["permutation"])]


@primitive("concatenate")
def _concatenate(s: Scalars, equation: Any, *operands: Numbers) -> Sequence[Numbers]:
    return [np.concatenate(operands, equation.params["dimension"])]


@primitive("stack")
def _stack(s: Scalars, equation: Any, *operands: Numbers) -> Sequence[Numbers]:
    return [np.stack(operands, equation.params["axis"])]


@primitive("unstack")
def _unstack(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    rows = np.moveaxis(x, equation.params["axis"], 0)
    return [rows[i : i + 1].reshape(rows.shape[1:]) for i in range(len(rows))]


@primitive("split")
def _split(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    return np.split(x, np.cumsum(equation.params["sizes"])[:-1], equation.params["axis"])


@primitive("tile")
def _tile(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    return [np.tile(x, equation.params["reps"])]


@primitive("rev")
def _rev(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    return [np.flip(x, equation.params["dimensions"])]


@primitive("slice")
def _slice(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    p = equation.params
    return [x[tuple(map(slice, p["start_indices"], p["limit_indices"], p["strides"] or (1,) * x.ndim))]]


@primitive("iota")
def _iota(s: Scalars, equation: Any) -> Sequence[Numbers]:
    aval, dimension = equation.outvars[0].aval, equation.params["dimension"]
    shape = [size if d == dimension else 1 for d, size in enumerate(aval.shape)]
    row = np.arange(aval.shape[dimension], dtype=aval.dtype).reshape(shape)
    return [known(np.broadcast_to(row, aval.shape))]


@primitive("empty")
def _empty(s: Scalars, equation: Any) -> Sequence[Numbers]:
    aval = equation.outvars[0].aval
    return [filled(aval.shape, aval.dtype.type(0))]


@primitive("pad")
def _pad(s: Scalars, equation: Any, x: Numbers, padding: Numbers) -> Sequence[Numbers]:
    result = filled(equation.outvars[0].aval.shape, padding[()])
    configured = equation.params["padding_config"]
    for at in np.ndindex(*x.shape):
        to = tuple(low + i * (between + 1) for i, (low, _, between) in zip(at, configured, strict=True))
        if all(0 <= i < size for i, size in zip(to, result.shape, strict=True)):
            result[to] = x[at]
    return [result]


@primitive("argmax", "argmin")
def _argmax(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    better = "gt" if equation.primitive.name == "argmax" else "lt"
    (axis,) = equation.params["axes"]
    aval = equation.outvars[0].aval

    def first(row: Sequence[Number]) -> Number:
        best, place = row[0], aval.dtype.type(0)
        for i, number in enumerate(row[1:], 1):
            improved = s.algebra.apply(better, number, best)
            best = s.algebra.apply("select", improved, number, best)
            place = s.algebra.apply("select", improved, aval.dtype.type(i), place)
        return place

    rows = np.moveaxis(x, axis, -1).reshape(-1, x.shape[axis])
    return [listed([first(list(row)) for row in rows], aval.shape)]


@primitive("top_k")
def _top_k(s: Scalars, equation: Any, x: Numbers) -> Sequence[Numbers]:
    if equation.params.get("axis", -1) not in (-1, x.ndim - 1):
        raise Unsupported("the largest along another dimension than the last")
    places = np.broadcast_to(known(np.arange(x.shape[-1], dtype=np.int32)), x.shape)
    return _sorted(s, "ge", x, [x, places], equation.params["k"])


@primitive("sort")
def _sort(s: Scalars, equation: Any, *operands: Numbers) -> Sequence[Numbers]:
    if equation.params["num_keys"] != 1:
        raise Unsupported("a sort by several keys")
    last = [np.moveaxis(x, equation.params["dimension"], -1) for x in operands]
    result = _sorted(s, "le", last[0], last, last[0].shape[-1])
    return [np.moveaxis(x, -1, equation.params["dimension"]) for x in result]


def _sorted(s: Scalars, before: str, keys: Numbers, columns: Sequence[Numbers], count: int) -> list[Numbers]:
    """Return each column's first `count` numbers, ordered by keys ("le": smallest first; "ge": largest first).

    Equal keys keep their order. With NaN among the keys the order is undefined.
    """
    size = keys.shape[-1]
    results = [np.empty((*keys.shape[:-1], count), object) for _ in columns]
    for at in np.ndindex(*keys.shape[:-1]):
        rows = [list(array[at]) for array in (keys, *columns)]
        for place in range(count):
            for i in reversed(range(place, size - 1)):  # the next in order moves to the front
                keep = s.algebra.apply(before, rows[0][i], rows[0][i + 1])
                for row in rows:
                    one, other = row[i], row[i + 1]
                    row[i] = s.algebra.apply("select", keep, one, other)
                    row[i + 1] = s.algebra.apply("select", keep, other, one)
        for result, row in zip(results, rows[1:], strict=True):
            result[at][:] = row[:count]
    return results


@primitive("dynamic_slice")
def _dynamic_slice(s: Scalars, equation: Any, x: Numbers, *starts: Numbers) -> Sequence[Numbers]:
    sizes = equation.params["slice_sizes"]
    result = np.empty(sizes, object)
    for at in np.ndindex(*sizes):
        places = [(d, start[()], x.shape[d] - sizes[d]) for d, start in enumerate(starts)]
        result[at] = _read(s, x, list(at), places)
    return [result]


@primitive("gather")
def _gather(s: Scalars, equation: Any, x: Numbers, indices: Numbers) -> Sequence[Numbers]:
    p, aval = equation.params, equation.outvars[0].aval
    numbers, sizes = p["dimension_numbers"], p["slice_sizes"]
    fill = None
    if p["mode"] == GatherScatterMode.FILL_OR_DROP:
        given = p["fill_value"]
        fill = known(np.asarray(np.nan if given is None else given, aval.dtype))[()]
    batch = [d for d in range(len(aval.shape)) if d not in numbers.offset_dims]
    dropped = (*numbers.collapsed_slice_dims, *numbers.operand_batching_dims)
    window = [d for d in range(x.ndim) if d not in dropped]
    result = np.empty(aval.shape, object)
    for to in np.ndindex(*aval.shape):
        row = tuple(to[d] for d in batch)
        at = [0] * x.ndim
        for d, offset in zip(window, numbers.offset_dims, strict=True):
            at[d] = to[offset]
        for d, of_indices in zip(numbers.operand_batching_dims, numbers.start_indices_batching_dims, strict=True):
            at[d] = row[of_indices]
        places = [(d, indices[(*row, k)], x.shape[d] - sizes[d]) for k, d in enumerate(numbers.start_index_map)]
        result[to] = _read(s, x, at, places, fill)
    return [result]


def _read(s: Scalars, x: Numbers, at: list[int], places: Sequence[Place], fill: Number | None = None) -> Number:
    """Return a number of a window: known positions are looked up, others selected among all possible ones.

    A window out of bounds gives `fill` if there is one; otherwise it moves to the nearest position in bounds.
    """
    if not places:
        return x[tuple(at)]
    (dimension, start, last), rest = places[0], places[1:]

    def begin(place: int) -> Number:
        moved = list(at)
        moved[dimension] += place
        return _read(s, x, moved, rest, fill)

    if is_known(start):
        inside = 0 <= start <= last
        return fill if fill is not None and not inside else begin(min(max(int(start), 0), last))
    value = begin(last)
    for place in reversed(range(last)):
        here = s.algebra.apply("eq" if place else "le", start, start.dtype.type(place))
        value = s.algebra.apply("select", here, begin(place), value)
    if fill is None:
        return value
    low, high = start.dtype.type(0), start.dtype.type(last)
    inside = s.algebra.apply("and", s.algebra.apply("ge", start, low), s.algebra.apply("le", start, high))
    return s.algebra.apply("select", inside, value, fill)


@primitive("scatter", "scatter-add", "scatter-mul")
def _scatter(s: Scalars, equation: Any, x: Numbers, indices: Numbers, updates: Numbers) -> Sequence[Numbers]:
    """Write windows at known positions; one out of bounds is dropped, or moved if the mode says so."""
    combine = equation.primitive.name.removeprefix("scatter").removeprefix("-")
    p = equation.params
    numbers = p["dimension_numbers"]
    if not combine and p["update_jaxpr"] is not None:
        raise Unsupported("applying a function at places")
    dropped = (*numbers.inserted_window_dims, *numbers.operand_batching_dims)
    window = [d for d in range(x.ndim) if d not in dropped]
    batch = [d for d in range(updates.ndim) if d not in numbers.update_window_dims]
    size = dict(zip(window, (updates.shape[d] for d in numbers.update_window_dims), strict=True))
    result = x.copy()
    for at in np.ndindex(*updates.shape):
        row = tuple(at[d] for d in batch)
        to = [0] * x.ndim
        inside = True
        for d, of_update in zip(window, numbers.update_window_dims, strict=True):
            to[d] = at[of_update]
        for d, of_indices in zip(numbers.operand_batching_dims, numbers.scatter_indices_batching_dims, strict=True):
            to[d] = row[of_indices]
        for k, d in enumerate(numbers.scatter_dims_to_operand_dims):
            if not is_known(indices[(*row, k)]):
                raise Unsupported("writing at places that are computed")
            start, last = int(indices[(*row, k)]), x.shape[d] - size.get(d, 1)
            inside &= 0 <= start <= last
            to[d] += min(max(start, 0), last)
        if inside or p["mode"] != GatherScatterMode.FILL_OR_DROP:
            place = tuple(to)
            result[place] = s.algebra.apply(combine, result[place], updates[at]) if combine else updates[at]
    return [result]
