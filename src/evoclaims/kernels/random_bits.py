"""Random numbers of jax's generator on processors: the same bits by a kernel, several times as fast as XLA's loop."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache, partial
from typing import Any, Final

import jax
import jax.numpy as jnp
from jax.extend.random import define_prng_impl, threefry_prng_impl
from jaxtyping import Array, PRNGKeyArray

from evoclaims.kernels import machine_code
from evoclaims.kernels.control import repeat
from evoclaims.kernels.group_kernel import LANES, Rows
from evoclaims.kernels.grouped import GroupKernel
from evoclaims.kernels.words import at, load

ROTATIONS: Final = ((13, 15, 26, 6), (17, 29, 16, 24))
"""Of the rounds of Threefry-2x32 (Salmon et al. 2011, Table 2)."""
PARITY: Final = 0x1BD11BDA
"""What makes the third key (ibid., §2)."""
THREEFRY: Final = "threefry2x32"


def fast(key: PRNGKeyArray) -> PRNGKeyArray:
    """Return a key, or keys, of the same random numbers, which are drawn by a kernel where there is one."""
    config: Any = jax.config  # defines its attributes at run time
    if jax.random.key_impl(key) != THREEFRY or not config.jax_threefry_partitionable:
        return key
    same: Array = jax.random.wrap_key_data(jax.random.key_data(key), impl=_GENERATOR)
    return same


def _random_bits(key: Array, bit_width: int, shape: tuple[int, ...]) -> Array:
    """Return random bits, given a key's numbers, uint32."""
    size = math.prod(shape)
    if bit_width != 32 or not size:
        drawn: Array = threefry_prng_impl.random_bits(key, bit_width, shape)
        return drawn
    (bits,) = _kernel(size)(jax.lax.bitcast_convert_type(key, jnp.int32))
    return jax.lax.bitcast_convert_type(bits, jnp.uint32).reshape(shape)


_GENERATOR: Final = define_prng_impl(
    key_shape=threefry_prng_impl.key_shape,
    seed=threefry_prng_impl.seed,
    split=threefry_prng_impl.split,
    random_bits=_random_bits,
    fold_in=threefry_prng_impl.fold_in,
    name="threefry2x32 by a kernel",
    tag="evoclaims",
)


@cache
def _kernel(size: int) -> GroupKernel:
    """Return the kernel that draws this many numbers with a key."""

    def function(key: Array) -> list[Array]:
        bits = threefry_prng_impl.random_bits(jax.lax.bitcast_convert_type(key, jnp.uint32), 32, (size,))
        return [jax.lax.bitcast_convert_type(bits, jnp.int32)]

    key, bits = (jax.ShapeDtypeStruct((count,), jnp.int32) for count in (2, size))
    write = partial(_write, size)
    return GroupKernel("The drawing of random numbers", function, (key,), (), (bits,), write, for_gpus=False)


def _write(size: int, rows: Rows, groups: Sequence[str], given: Sequence[str], results: Sequence[str]) -> None:
    """Write a loop over vectors of places; the last one overlaps with the one before where they do not fit."""
    page, (key,), (bits,) = rows.page, groups, results
    width = min(LANES * machine_code.lanes(), 1 << (size.bit_length() - 1))
    vector = f"<{width} x i32>"

    def everywhere(number: str) -> str:
        one = page.put(f"insertelement {vector} poison, i32 {number}, i64 0")
        return page.put(f"shufflevector {vector} {one}, {vector} poison, {vector} zeroinitializer")

    first, second = (load(page, key, place) for place in "01")
    third = page.put(f"xor i32 {page.put(f'xor i32 {first}, {second}')}, {PARITY}")
    keys = [everywhere(number) for number in (first, second, third)]
    lanes = f"<{', '.join(f'i32 {lane}' for lane in range(width))}>"

    def draw(block: str) -> list[str]:
        begin = page.put(f"mul i32 {block}, {width}")
        place = page.call("llvm.smin.i32", "i32", [("i32", begin), ("i32", str(size - width))])
        x, y = keys[0], page.put(f"add {vector} {page.put(f'add {vector} {everywhere(place)}, {lanes}')}, {keys[1]}")
        for group in range(5):
            for rotation in ROTATIONS[group % 2]:
                x = page.put(f"add {vector} {x}, {y}")
                turned = [(vector, y), (vector, y), (vector, f"splat (i32 {rotation})")]
                y = page.put(f"xor {vector} {page.call(f'llvm.fshl.v{width}i32', vector, turned)}, {x}")
            x = page.put(f"add {vector} {x}, {keys[(group + 1) % 3]}")
            added = page.put(f"add {vector} {keys[(group + 2) % 3]}, splat (i32 {group + 1})")
            y = page.put(f"add {vector} {y}, {added}")
        page.write(f"store {vector} {page.put(f'xor {vector} {x}, {y}')}, ptr {at(page, bits, place)}, align 4")
        return []

    repeat(page, "0", str(-(-size // width)), [], draw)
