"""Random numbers of jax's generator on processors: the same bits by two kernels.

XLA makes loops and about a dozen kernels of its own of every draw and every new key, and takes longer to compile them
than most smoke trials take to run; drawing takes it several times as long, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import jax
import jax.numpy as jnp
from jax.extend.random import define_prng_impl, threefry_prng_impl
from jaxtyping import Array, Int32, PRNGKeyArray, UInt32

from evoclaims.kernels.call import calls
from evoclaims.kernels.call.grouped import GroupKernel
from evoclaims.kernels.emit import machine_code
from evoclaims.kernels.emit.control import at, load, repeat, store
from evoclaims.kernels.emit.group_kernel import LANES, Rows
from evoclaims.kernels.emit.host_kernel import WIDE, handler
from evoclaims.kernels.emit.llvm_ir import Instructions

ROTATIONS: Final = ((13, 15, 26, 6), (17, 29, 16, 24))
"""Of the rounds of Threefry-2x32 (Salmon et al. 2011, Table 2)."""
PARITY: Final = 0x1BD11BDA
"""What makes the third key (ibid., §2)."""
THREEFRY: Final = "threefry2x32"


def kernel_prng(key: PRNGKeyArray) -> PRNGKeyArray:
    """Return a key, or keys, of the same random numbers, which kernels draw on processors, where there are kernels.

    Keys derived from it are such keys, too.
    """
    config: Any = jax.config  # defines its attributes at run time
    if jax.random.key_impl(key) != THREEFRY or not config.jax_threefry_partitionable or not _FOLDING.supported:
        return key
    same: Array = jax.random.wrap_key_data(jax.random.key_data(key), impl=_GENERATOR)
    return same


def _random_bits(key: UInt32[Array, " 2"], bit_width: int, shape: tuple[int, ...]) -> Array:
    size = math.prod(shape)
    if bit_width > 32 or not 0 < size <= 2**30:  # the kernel counts in int32
        drawn: Array = threefry_prng_impl.random_bits(key, bit_width, shape)
        return drawn
    bits: Array = calls.CALL.bind(key, kernel=_Drawing(size))[0]
    return bits.reshape(shape).astype(f"uint{bit_width}")


def _fold_in(key: UInt32[Array, " 2"], data: Any) -> UInt32[Array, " 2"]:
    """Return the key that a key and a number, uint32, make."""
    (made,) = _FOLDING(*(jax.lax.bitcast_convert_type(words, jnp.int32) for words in (key, data.reshape(1))))
    return jax.lax.bitcast_convert_type(made, jnp.uint32)


def _split(key: UInt32[Array, " 2"], shape: tuple[int, ...]) -> UInt32[Array, "*shape 2"]:
    """Return the keys that a key makes with each number from 0 on."""
    numbers = jnp.arange(math.prod(shape), dtype=jnp.uint32)
    return jax.vmap(_fold_in, (None, 0))(key, numbers).reshape(*shape, 2)


_GENERATOR: Final = define_prng_impl(
    key_shape=threefry_prng_impl.key_shape,
    seed=threefry_prng_impl.seed,
    split=_split,
    random_bits=_random_bits,
    fold_in=_fold_in,
    name="threefry2x32 by a kernel",
    tag="evoclaims",
)


@dataclass(frozen=True)
class _Drawing(calls.Callee):
    """The kernel that draws `size` numbers with a key; for GPUs jax has one. Its text is the same for all sizes."""

    size: int

    @property
    def outputs(self) -> calls.Shapes:
        """Shapes of the results of one key."""
        return [jax.ShapeDtypeStruct((self.size,), jnp.uint32)]

    def batch(self, leaves: Sequence[Any]) -> tuple[int, ...]:
        """Return the batch dimensions."""
        shape: tuple[int, ...] = leaves[0].shape[:-1]
        return shape

    def as_it_is(self, *keys: Array) -> list[Array]:
        """Draw by jax's own generator."""
        (key,) = keys
        if key.ndim > 1:
            made: list[Array] = jax.vmap(self.as_it_is)(key)
            return made
        return [threefry_prng_impl.random_bits(key, 32, (self.size,))]

    def on_host(self, *keys: Array) -> list[Array]:
        """Draw by the kernel for this machine's processor."""
        batch = self.batch(keys)
        count = math.prod(batch)
        if not count:
            return [jnp.zeros((*batch, self.size), jnp.uint32)]
        shapes = [jax.ShapeDtypeStruct((count, self.size), jnp.uint32)]
        operands = [keys[0].reshape(count, 2)]
        (bits,) = calls.on_host(_drawing(machine_code.lanes()), [count, self.size], operands, shapes)
        return [bits.reshape(*batch, self.size)]


@cache
def _drawing(lanes: int) -> str:
    """Return the text of the kernel that draws numbers, in vectors; the last one is stored in part."""
    width = LANES * lanes
    page = Instructions(width)
    vector, places = page.vector("i32"), page.numbers_of_lanes()
    page.label("entry")
    keys, size = (page.put(f"trunc i64 {number} to i32") for number in ("%keys", "%size"))
    whole = page.put(f"sdiv i32 {size}, {width}")
    all_ = page.put(f"sdiv i32 {page.put(f'add i32 {size}, {width - 1}')}, {width}")

    def one_key(number: str) -> list[str]:
        wide = page.put(f"zext i32 {number} to i64")
        key = page.put(f"getelementptr i32, ptr %a0, i64 {page.put(f'mul i64 {wide}, 2')}")
        row = page.put(f"getelementptr i32, ptr %z0, i64 {page.put(f'mul i64 {wide}, %size')}")
        rounds = [page.in_all_lanes("i32", part) for part in _three_keys(page, key)]

        def drawn(block: str) -> tuple[str, str]:
            begin = page.put(f"mul i32 {block}, {width}")
            counters = page.put(f"add {vector} {page.in_all_lanes('i32', begin)}, {places}")
            first, second = _block(page, rounds, counters)
            return begin, page.put(f"xor {vector} {first}, {second}")

        def draw_all(block: str) -> list[str]:
            begin, bits = drawn(block)
            page.write(f"store {vector} {bits}, ptr {at(page, row, begin)}, align 4")
            return []

        def draw_some(block: str) -> list[str]:
            begin, bits = drawn(block)
            left = page.in_all_lanes("i32", page.put(f"sub i32 {size}, {begin}"))
            inside = (page.vector("i1"), page.put(f"icmp slt {vector} {places}, {left}"))
            operands = [(vector, bits), ("ptr", at(page, row, begin)), ("i32", "4"), inside]
            page.call(f"{page.mangled('masked.store', 'i32')}.p0", "void", operands)
            return []

        repeat(page, "0", whole, [], draw_all)
        repeat(page, whole, all_, [], draw_some)
        return []

    repeat(page, "0", keys, [], one_key)
    page.write("ret void")
    body = "\n".join(page.lines)
    work = f"define internal void @work(i64 %keys, i64 %size, ptr %a0, ptr %z0) {WIDE} {{\n{body}\n}}\n"
    return "\n".join(page.declared) + "\n" + work + handler(2, 1, 1)


def _folded(key: Int32[Array, " 2"], data: Int32[Array, " 1"]) -> list[Int32[Array, " 2"]]:
    """Return the key that a key and a number make, by jax's own generator."""
    words = (jax.lax.bitcast_convert_type(part, jnp.uint32) for part in (key, data[0]))
    return [jax.lax.bitcast_convert_type(threefry_prng_impl.fold_in(*words), jnp.int32)]


def _write_folded(rows: Rows, groups: Sequence[str], given: Sequence[str], results: Sequence[str]) -> None:
    """Write a loop over pairs of a key and a number."""
    page, (keys, data), (made,) = rows.page, given, results

    def fold(row: str) -> list[str]:
        twice = page.put(f"mul i32 {row}, 2")
        words = _block(page, _three_keys(page, at(page, keys, twice)), load(page, data, row))
        for place, word in enumerate(words):
            store(page, word, at(page, made, twice), str(place))
        return []

    repeat(page, "0", rows.count, [], fold)


_PAIR, _ONE = (jax.ShapeDtypeStruct((count,), jnp.int32) for count in (2, 1))
_FOLDING: Final = GroupKernel(
    "The making of random keys",
    _folded,
    groups=(),
    rows=(_PAIR, _ONE),
    outputs=(_PAIR,),
    write=_write_folded,
    one_lane=True,
    for_gpus=False,
)


def _three_keys(page: Instructions, key: str) -> list[str]:
    """Return the keys of the rounds, i32, given the address of a key."""
    first, second = (load(page, key, place) for place in "01")
    third = page.put(f"xor i32 {page.put(f'xor i32 {first}, {second}')}, {PARITY}")
    return [first, second, third]


def _block(page: Instructions, keys: Sequence[str], counters: str) -> tuple[str, str]:
    """Write Threefry-2x32 of (0, counter) for a counter in each lane; return both words."""
    type_ = page.vector("i32")
    x, y = keys[0], page.put(f"add {type_} {counters}, {keys[1]}")
    for group in range(5):
        for rotation in ROTATIONS[group % 2]:
            x = page.put(f"add {type_} {x}, {y}")
            turns = page.splat("i32", str(rotation))
            turned = page.call(page.mangled("fshl", "i32"), type_, [(type_, y), (type_, y), (type_, turns)])
            y = page.put(f"xor {type_} {turned}, {x}")
        x = page.put(f"add {type_} {x}, {keys[(group + 1) % 3]}")
        added = page.put(f"add {type_} {keys[(group + 2) % 3]}, {page.splat('i32', str(group + 1))}")
        y = page.put(f"add {type_} {y}, {added}")
    return x, y
