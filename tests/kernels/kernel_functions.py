"""Functions that can be one kernel, and functions that can not: together they use all that kernels know of."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from evoclaims.kernels.trace.seldom import seldom

X = np.random.default_rng(0).normal(size=(37, 4)).astype(np.float32)  # the second block is not full
Y = np.random.default_rng(1).normal(size=(37, 4)).astype(np.float32)
I = np.random.default_rng(2).integers(-9, 9, (37, 4)).astype(np.int32)
B = X > 0.3
KEY = jax.random.key(0)
SYMMETRIC = jnp.eye(4) * 3.0
TABLE = jnp.asarray(np.arange(20, dtype=np.float32).reshape(5, 4) ** 2)
OUTSIDE = jnp.array([7, 1])


def _carries(x: Any, y: Any) -> Any:
    def swap(carry: Any, _: None) -> Any:
        a, b, c, n, flag = carry
        return (b, a, c * 0.5 + y, n + 1, ~flag), None

    return jax.lax.scan(swap, (x, x * 2, y, jnp.int32(0), jnp.zeros((), bool)), None, length=5)[0]


def _with_numbers_from_outside(x: Any, y: Any) -> Any:
    sine, total = jnp.sin(x), jnp.sum(jnp.cos(y))

    def following(carry: Any, _: None) -> Any:
        near = carry * sine + total  # first: what is from outside must be there again in the next round
        far = jnp.cos(near) + jnp.cos(near[::-1] * 2.0)
        return jnp.cos(far + far[::-1]) + jnp.sum(far) * 0.1, None

    return jax.lax.scan(following, x, None, length=3)[0]


def _nested(x: Any) -> Any:
    def outer(a: Any, _: None) -> Any:
        inner = jax.lax.scan(lambda b, _: (b * 0.5 + x * 3 + jnp.sqrt(a * a), None), x, None, length=3)[0]
        return inner, None

    return jax.lax.scan(outer, x, None, length=2)[0]


def _solve(x: Any, y: Any) -> Any:
    matrix = SYMMETRIC + jnp.outer(x, x)
    return jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(matrix), y), jnp.linalg.cholesky(matrix)


def _with_a_shortcut(x: Any, y: Any) -> Any:
    """Collide, so to say: of four gaps, the last two are seldom negative, and then they push, and that is dear."""

    def following(carry: Any, _: None) -> Any:
        place, speed = carry
        gaps = place * y
        far = jnp.where(seldom(gaps[2:] < -0.5), gaps[2:], 1.0)
        gaps = gaps.at[2:].set(far)
        pushes = jnp.where(gaps < 0.0, gaps, 0.0)
        dear = jnp.outer(pushes, jnp.sin(speed)) @ jnp.sin(x * speed)
        faster = speed * 0.9 + x * 0.1 - pushes * jnp.cos(speed[::-1]) + dear
        return (place * 0.8 + faster * 0.1, faster), None

    return jax.lax.scan(following, (x, y), None, length=5)[0]


FUNCTIONS: dict[str, tuple[Callable[..., Any], tuple[Any, ...]]] = {
    "arithmetic": (lambda x, y: ((x + y) * x - y / (x + 9.0), -x, jnp.abs(y), x * 0.0 + 1.0, x / 4.0), (X, Y)),
    "roots and powers": (lambda x: (jnp.sqrt(x * x), jax.lax.rsqrt(x * x + 1.0), x**3, x**-2, jnp.square(x)), (X,)),
    "a loop with a shortcut": (_with_a_shortcut, (X, Y)),
    "a power by a float": (lambda x: jnp.power(x, 2.0), (X,)),
    "sine and cosine": (lambda x: (jnp.sin(x * 50.0), jnp.cos(x * 50.0)), (X,)),
    "exponentials": (lambda x: (jnp.exp(x), jnp.expm1(x), jnp.tanh(x), jax.nn.sigmoid(x)), (X,)),
    "logarithms": (lambda x: (jnp.log(x * x), jnp.log1p(x * x)), (X,)),
    "any power": (lambda x, y: (jnp.power(x * x, y), jnp.power(jnp.abs(x), 0.5), jnp.power(x * x, 17.5)), (X, Y)),
    "bits": (
        lambda x, i: (
            jax.lax.bitcast_convert_type(x, jnp.int32),
            jax.lax.bitcast_convert_type(i, jnp.float32),
            i << 3,
            i >> 2,
            jax.lax.shift_right_logical(i, jnp.int32(28)),
        ),
        (X, I),
    ),
    "an angle": (jnp.arctan2, (X, Y)),
    "places of a mask that is known": (lambda x: x[jnp.nonzero(jnp.arange(x.shape[0]) % 2 == 0, size=1)[0]], (X,)),
    "rounding": (lambda x: (jnp.floor(x * 3), jnp.ceil(x * 3), jnp.sign(x), jnp.round(x * 3), jnp.trunc(x * 3)), (X,)),
    "halves to even": (lambda i: (jnp.round(i / 2), jnp.sign(i)), (I,)),
    "division of integers": (
        lambda i: (i // 3, i % 4, jax.lax.rem(i, jnp.int32(-4)), jax.lax.div(i, jnp.int32(-3))),
        (I,),
    ),
    "extremes": (lambda x, y: (jnp.maximum(x, y), jnp.minimum(x, y), jnp.clip(x, -0.5, 0.5), jnp.max(x)), (X, Y)),
    "not a number": (
        lambda x: (
            jnp.maximum(jnp.sqrt(x), 0.5),
            jnp.minimum(0.5, jnp.sqrt(x)),
            jnp.isfinite(jnp.sqrt(x)),
            jnp.sqrt(x) != 1,
        ),
        (X,),
    ),
    "integers": (
        lambda i: (i * i - 3, -i, jnp.abs(i), i & 3, i | 4, i ^ 5, ~i, jnp.maximum(i, 2), jnp.minimum(i, 2)),
        (I,),
    ),
    "comparisons": (lambda x, y: (x < y, x <= y, x > y, x >= y, x == x.round(), x != y), (X, Y)),
    "comparisons of integers": (lambda i: (i < 2, i <= 2, i > 2, i >= 2, i == 2, i != 2), (I,)),
    "conditions": (lambda a, b: (a & b, a | b, a ^ b, ~a, a == b, a != b, jnp.all(a), jnp.any(b)), (B, B[::-1])),
    "known conditions": (
        lambda a: (a & jnp.array([True, False, True, False]), a | jnp.array([True, False, True, False])),
        (B,),
    ),
    "selection": (lambda b, x, i: (jnp.where(b, x, 2.0), jnp.where(b, i, 7), jnp.where(b, x > 0, x < -1)), (B, X, I)),
    "selection by one": (lambda b, x, y: jax.lax.select_n(b[0], x, y), (B, X, Y)),
    "zeros of both signs": (lambda x: 1.0 / jnp.where(x > 0, 0.0, -0.0), (X,)),
    "casts": (
        lambda x, i, b: (i.astype(float), (x * 9).astype(int), b.astype(float), b.astype(int), i.astype(bool)),
        (X, I, B),
    ),
    "sums": (lambda x: (jnp.sum(x), jnp.prod(x), jnp.cumsum(x), jax.lax.cumsum(x, reverse=True), jnp.sum(x[:0])), (X,)),
    "the extremes of nothing": (
        lambda x, i: (jnp.max(x[:0], initial=-3.0), jnp.max(i[:0], initial=0), jnp.all(x[:0] > 0)),
        (X, I),
    ),
    "products": (lambda x, y: (x @ y, jnp.outer(x, y) @ y, jnp.einsum("i,j,ij->ij", x, y, SYMMETRIC)), (X, Y)),
    "products of batches": (
        lambda x: jnp.einsum(
            "bij,bjk->bik", TABLE.reshape(5, 2, 2) * x[0], x.reshape(1, 2, 2) + TABLE.reshape(5, 2, 2)
        ),
        (X,),
    ),
    "a system": (_solve, (X, Y)),
    "shapes": (
        lambda x: (x.reshape(2, 2).T, jnp.concatenate([x, x[1:3]]), jnp.stack([x, x]), jnp.tile(x, 2), jnp.pad(x, 1)),
        (X,),
    ),
    "parts": (
        lambda x: (*jnp.split(x, [1, 3]), *jnp.unstack(jnp.outer(x, x), axis=1), jax.lax.pad(x, 0.0, [(1, -1, 2)])),
        (X,),
    ),
    "indices": (lambda x: (x[jnp.array([2, 0])], x.at[1].set(0.0), x.at[jnp.array([0, 0])].add(1.0), x[::-2]), (X,)),
    "indices out of bounds": (
        lambda x: (
            x.at[OUTSIDE].get(mode="fill", fill_value=0.5),
            x.at[OUTSIDE].get(mode="clip"),
            x.at[OUTSIDE].set(9.0),
            x.at[OUTSIDE].set(9.0, mode="clip"),
            x.at[OUTSIDE].multiply(9.0),
        ),
        (X,),
    ),
    "rows of rows": (
        lambda x: (jax.vmap(lambda row, k: row[k])(TABLE * x, jnp.arange(5) % 4), TABLE.at[1:3, 2].add(x[:2])),
        (X,),
    ),
    "rows written": (lambda x: jax.vmap(lambda row, k: row.at[k].set(7.0))(TABLE * x, jnp.arange(5) % 4), (X,)),
    "computed indices": (lambda i: (TABLE[i % 5], TABLE[i % 5, i % 4], jnp.take(TABLE, i, axis=0), TABLE[i]), (I,)),
    "a computed slice": (lambda x, i: jax.lax.dynamic_slice(x, (i[0],), (2,)), (X, I)),
    "order": (lambda x: (jnp.argmax(x), jnp.argmin(x), jax.lax.top_k(x, 2), jnp.sort(x), jnp.argsort(x)), (X,)),
    "order of integers": (
        lambda i: (jnp.argmax(i), jax.lax.top_k(jnp.where(i < 0, -(2**31), i), 2), jnp.sort(i)),
        (I,),
    ),
    "order in columns": (
        lambda x: (jnp.sort(TABLE * x, axis=0), jnp.argmax(TABLE * x, axis=0), jnp.argmin(TABLE * x)),
        (X,),
    ),
    "choices of equals": (
        lambda x, y: (
            jnp.where(x > 0, y, jnp.where(y > 0, y, x)),
            jnp.where(x > 0, 1.0, jnp.where(y > 0, 1.0, jnp.where(x > y, 2.0, 1.0))),
            jnp.where(x > 0, x, jnp.where(y > 0, y, x)),
            jnp.where(x > 0, y > x, jnp.where(y > 0, y > x, x > 1)),
        ),
        (X, Y),
    ),
    "a loop": (_carries, (X, Y)),
    "a loop with numbers from outside": (_with_numbers_from_outside, (X, Y)),
    "loops in a loop": (_nested, (X,)),
    "no rounds": (lambda x: jax.lax.fori_loop(0, 0, lambda _, c: c + 1, x), (X,)),
    "calls": (lambda x: jax.jit(jnp.linalg.norm)(x) + jax.nn.relu(x), (X,)),
    "what is known": (lambda x: (jnp.arange(3), jnp.zeros((2, 2)), jnp.array([True, False]), jnp.zeros(0), x), (X,)),
}

NO_KERNELS: dict[str, Callable[..., Any]] = {
    "writing at a computed place": lambda x: x.at[jnp.int32(x[0]) % 4].set(0.0),
    "a function applied at places": lambda x: x.at[1].apply(jnp.sin),
    "a loop over rows": lambda x: jax.lax.scan(lambda c, r: (c + r, c), 0.0, x),
    "halves": lambda x: x.astype(jnp.float16),
    "known bytes": lambda x: (x, jnp.zeros(3, jnp.int8)),
    "a remainder of floats": lambda x: jax.lax.rem(x, jnp.full_like(x, 0.3)),
    "division by what may be 0": lambda x: jax.lax.div(7 + 0 * x.astype(int), x.astype(int)),
    "a shift by a computed number": lambda x: jax.lax.shift_left(x.astype(int), x.astype(int)),
    "the bits of halves": lambda x: jax.lax.bitcast_convert_type(x, jnp.float16),
    "a large power": lambda x: x**17,
    "the larger condition": lambda x: jnp.maximum(x > 0, x < 1),
    "rounding halves away from zero": jax.lax.round,
    "one of three": lambda x: jax.lax.select_n(jnp.abs(x.astype(int)) % 3, x, x, x),
    "a system from the right": lambda x: jax.lax.linalg.triangular_solve(SYMMETRIC, jnp.outer(x, x)),
    "a sort by two keys": lambda x: jax.lax.sort((x, x), num_keys=2),
    "random numbers": lambda x: x + jax.random.uniform(jax.random.key(0)),
    "a random key": lambda x: x + jax.random.uniform(KEY),
}
