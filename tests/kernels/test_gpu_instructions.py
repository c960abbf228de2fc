"""Quotients and roots that GPUs compute from approximations are those of IEEE 754, to the bit."""

from __future__ import annotations

import ctypes
import itertools
from collections.abc import Callable
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from approximations import on_a_processor

from evoclaims.kernels.call.kernel import Kernel
from evoclaims.kernels.emit import block_kernel, gpu_kernel, group_kernel, host_kernel, machine_code
from evoclaims.kernels.emit.block_kernel import BlockShape
from evoclaims.kernels.emit.gpu_instructions import GpuInstructions
from evoclaims.kernels.emit.group_kernel import Rows, Sizes
from evoclaims.kernels.emit.llvm_ir import literal
from evoclaims.kernels.emit.shared_slots import slots
from evoclaims.kernels.emit.warp_schedule import schedule
from evoclaims.kernels.trace.expressions import Input, in_order

UNITS = (-2, -1, 0, 1, 2)
"""How far off an approximation may be."""
MANY = 1_000_000
F = np.float32


@cache
def _compiled(write: Callable[[GpuInstructions, str, str], str], units: int) -> Any:
    """Return a function of addresses a, b, made, and a count, which computes what is written for each a and b."""
    page = GpuInstructions()
    page.label("entry")
    page.write("br label %again")
    page.label("again")
    page.write("%i = phi i64 [ 0, %entry ], [ %next, %again ]")
    a, b, made = (page.put(f"getelementptr float, ptr %{name}, i64 %i") for name in ("a", "b", "made"))
    value = write(page, page.put(f"load float, ptr {a}"), page.put(f"load float, ptr {b}"))
    page.write(f"store float {value}, ptr {made}", "%next = add i64 %i, 1", "%more = icmp ult i64 %next, %count")
    page.write("br i1 %more, label %again, label %done", "done:", "ret void")
    lines = ["define void @all(ptr %a, ptr %b, ptr %made, i64 %count) {", *page.lines, "}"]
    text = on_a_processor("\n".join([*page.declared, *lines]) + "\n", units)
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3, ctypes.c_int64)(machine_code.address(text, "all"))


def _run(write: Callable[[GpuInstructions, str, str], str], units: int, a: Any, b: Any) -> Any:
    """Return what is written for each a and b, of which there is at least one."""
    a, b = (np.ascontiguousarray(x, F) for x in (a, b))
    made = np.empty_like(a)
    _compiled(write, units)(a.ctypes.data, b.ctypes.data, made.ctypes.data, a.size)
    return made


def _quotient(page: GpuInstructions, a: str, b: str) -> str:
    return page.divided(a, b)


def _root(page: GpuInstructions, a: str, b: str) -> str:
    return page.root(a)


def _same_bits(made: Any, wanted: Any) -> Any:
    """Return where results are the same; all NaN are."""
    return (made.view(np.int32) == wanted.view(np.int32)) | (np.isnan(made) & np.isnan(wanted))


def _units_off(made: Any, wanted: Any) -> Any:
    """Return how many numbers further a result is than it should be; 0 for two NaN."""
    bits = [x.view(np.int32).astype(np.int64) for x in (made, wanted)]
    ordered = [np.where(x < 0, -(x & 0x7FFFFFFF), x) for x in bits]
    return np.where(np.isnan(made) & np.isnan(wanted), 0, np.abs(ordered[0] - ordered[1]))


def _check(a: Any, b: Any, made: Any) -> None:
    """Check quotients: the bits of IEEE's, except where the documentation says otherwise."""
    a, b = F(a), F(b)
    with np.errstate(all="ignore"):
        wanted = a / np.where(np.abs(b) <= 2.0**-128, np.copysign(F(0), b), b)
    inexact = (np.abs(a) < 2.0**-102) | (np.abs(b) > 2.0**126) | (np.abs(wanted) < 2.0**-126)
    allowed = np.where(inexact, 1, 0)
    allowed = np.where(np.abs(a) < 2.0**-122, 5, allowed)
    largest = (np.abs(wanted) > np.finfo(F).max * (1 - 2.0**-21)) & (made == np.copysign(F(np.inf), wanted))
    wrong = (_units_off(made, wanted) > allowed) & ~largest
    assert not wrong.any(), [(x[wrong][:3], x[wrong].size) for x in (a, b, made, wanted)]
    assert (np.signbit(made) == np.signbit(wanted))[~np.isnan(wanted)].all()


def _any_bits(seed: int, count: int = MANY) -> Any:
    return np.random.default_rng(seed).integers(0, 2**32, count, np.uint32).view(F)


def _of_like_size() -> tuple[Any, Any]:
    random = np.random.default_rng(3)
    a, b = (F(random.normal(size=MANY) * 2.0 ** random.integers(-40, 40, MANY)) for _ in range(2))
    return a, b


def _near_midpoints(divisor: Any) -> tuple[Any, Any]:
    """Return pairs whose quotient is as near to the middle between two numbers as one of its divisor can be.

    With whole B (24 bits, odd) and M (25 bits, odd), (B M + c) / 2^k is a whole A for M = -c / B modulo 2^k; A / B is
    then c / (2^k B) units of M from M, the middle between two numbers of 24 bits.
    """
    random = np.random.default_rng(4)
    inverse = divisor.copy()  # to three bits; each step doubles them
    for _ in range(5):
        inverse = inverse * (2 - divisor * inverse)
    c = random.choice(np.array([-7, -5, -3, -1, 1, 3, 5, 7]), divisor.size).astype(np.int64).view(np.uint64)
    bits = random.choice(np.array([24, 25], np.uint64), divisor.size)
    middle = (np.uint64(0) - c) * inverse & ((np.uint64(1) << bits) - np.uint64(1))
    middle |= np.where(bits == 24, np.uint64(2**24), np.uint64(0))
    dividend = (divisor * middle + c) >> bits
    good = (middle >= 2**24) & (dividend >= 2**23) & (dividend < 2**24)
    return F(dividend[good]), F(divisor[good])


def _next_to_the_middle(divisors: Any) -> tuple[Any, Any]:
    a, b = _near_midpoints(divisors)
    assert a.size > divisors.size / 8
    distance = np.abs(np.float64(a) / np.float64(b) / np.spacing(a / b) % 1 - 0.5)
    assert distance.max() < 2.0**-19
    signs = np.random.default_rng(6).choice(F([-1, 1]), a.size)
    return np.tile(a * signs, 3), np.concatenate([b * F(2.0**power) for power in (0, 60, -60)])


SPECIAL = F(
    [0, np.inf, 2**-149, 2**-148, 2**-127, 2**-126, 2**-125, 1 / 3, 1, 3, 2**125, 2**126, 2**127, np.finfo(F).max]
)
SPECIALS = np.concatenate([SPECIAL, -SPECIAL, F([np.nan]), np.nextafter(F(2**-126), F(0))[None]])


PAIRS: dict[str, Callable[[], tuple[Any, Any]]] = {
    "any": lambda: (_any_bits(1), _any_bits(2)),
    "of like size": _of_like_size,
    "next to the middle, any divisor": lambda: _next_to_the_middle(
        np.random.default_rng(5).integers(2**22, 2**23, MANY, np.uint64) * 2 + 1
    ),
    "next to the middle, large divisors": lambda: _next_to_the_middle(
        np.tile(2**24 - np.arange(1, 2000, 2, dtype=np.uint64), 100)
    ),
    "next to the middle, small divisors": lambda: _next_to_the_middle(
        np.tile(2**23 + np.arange(1, 2000, 2, dtype=np.uint64), 100)
    ),
    "special": lambda: tuple(np.array(list(itertools.product(SPECIALS, SPECIALS)), F).T),
    # where a step of Newton's is not enough
    "powers of two, just below one": lambda: (F(2.0) ** np.arange(-90, 90, dtype=F), np.full(180, 1 - 2.0**-24, F)),
    "denormal, in the middle": lambda: (F(3 * (2 * np.arange(1_000) + 1) * 2.0**-90), np.full(1_000, 3 * 2.0**60, F)),
}


@pytest.mark.oldest
@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("pairs", PAIRS.values(), ids=PAIRS)
def test_quotients_have_ieees_bits(pairs: Callable[[], tuple[Any, Any]], units: int) -> None:
    a, b = pairs()
    _check(a, b, _run(_quotient, units, a, b))


@pytest.mark.oldest
@pytest.mark.parametrize(
    ("divisor", "every"),
    [(0.95440036, True), (-11.313708, True), *((other, False) for other in (3.0, 1e-30, 3e38, 1e-44, 2.0**24, 0.0))],
)
def test_quotients_by_known_numbers_are_ieees(divisor: float, every: bool) -> None:
    known = F(divisor)

    def by_known(page: GpuInstructions, a: str, b: str) -> str:
        return page.divided(a, literal(known))

    mantissas = np.arange(2**23 if every else 2**17, dtype=np.uint32) + np.uint32(127 << 23)
    every_a = np.concatenate([SPECIALS, _any_bits(6), mantissas.view(F)])
    for a in np.array_split(every_a, max(1, every_a.size // 2**19)):  # at once, a check takes 700 MB
        _check(a, np.broadcast_to(known, a.shape), _run(by_known, 1, a, a))


@pytest.mark.oldest
@pytest.mark.parametrize("units", [0, 1, 2])  # with fewer, the reciprocal of 2^-128 is finite
def test_divisors_of_at_most_2_to_the_minus_128_count_as_0(units: int) -> None:
    a, b = np.array(list(itertools.product(SPECIALS, F([2.0**-128, -(2.0**-128), 2.0**-129, 2.0**-149]))), F).T
    _check(a, b, _run(_quotient, units, a, b))


@pytest.mark.oldest
@pytest.mark.parametrize("units", UNITS)
def test_denormal_quotients_are_ieees_but_for_those_in_the_middle_of_two_numbers(units: int) -> None:
    thirds, b = F(3 * np.arange(3_000) * 2.0**-90), F(3 * 2.0**60)
    made, wanted = _run(_quotient, units, thirds, np.broadcast_to(b, thirds.shape)), thirds / b
    assert _same_bits(made, wanted)[::2].all()


@pytest.mark.oldest
@pytest.mark.parametrize("units", UNITS)
def test_roots_of_all_mantissas_have_ieees_bits(units: int) -> None:
    x = np.arange(2**24, dtype=np.uint32) + np.uint32(127 << 23)  # [1, 4): an even and an odd exponent
    for part in np.array_split(x.view(F), 32):
        assert _same_bits(_run(_root, units, part, part), np.sqrt(part)).all()


@pytest.mark.oldest
@pytest.mark.parametrize("units", UNITS)
def test_roots_of_any_numbers_have_ieees_bits(units: int) -> None:
    x = np.concatenate(
        [SPECIALS, _any_bits(8), np.abs(_any_bits(9)), np.nextafter(F(0), F(1)) * np.arange(9_999, dtype=F)]
    )
    with np.errstate(all="ignore"):
        assert _same_bits(_run(_root, units, x, x), np.sqrt(x)).all()


def test_quotients_by_the_same_number_share_its_reciprocal_within_a_basic_block() -> None:
    page = GpuInstructions()
    page.label("entry")
    for dividend in ("%x", "%y", "%z"):
        page.divided(dividend, "%n")
    assert sum("rcp.approx" in line for line in page.lines) == 1
    page.divided("%x", "%m")
    page.label("another")
    page.divided("%y", "%n")
    assert sum("rcp.approx" in line for line in page.lines) == 3


def _kernel() -> Kernel:
    def function(x: Any, y: Any) -> Any:
        return jnp.sqrt(x) / y + y / 3.0

    number = jax.ShapeDtypeStruct((), jnp.float32)
    return Kernel(function, "This", jax.tree.structure((0, 0)), (number, number))


def _of_one_warp(kernel: Kernel) -> str:
    return gpu_kernel.text(kernel.results, kernel.read, {0: 1, 1: 1}, 5)


def _of_two_warps(kernel: Kernel) -> str:
    numbers = list(kernel.results[0].flat)
    plan = schedule(numbers, 2)
    assert plan is not None
    shape = BlockShape(plan, slots(plan, numbers), 1)
    return block_kernel.text(shape, kernel.results, kernel.read, {0: 1, 1: 1}, 5)


def _of_groups(kernel: Kernel) -> str:
    (result,) = kernel.results[0].flat

    def write(rows: Rows, of_groups: Any, of_rows: Any, results: Any) -> None:
        def load(number: Input) -> str:
            return rows.load(of_rows[number.array], 1, number.place)

        registers: dict[int, str] = {}
        rows.page.compute(in_order([result]), registers, load)
        rows.store(results[0], 1, 0, registers[id(result)])

    return group_kernel.gpu_text(write, Sizes((), (1, 1), (1,)), 2, 3, [True, True])


@pytest.mark.parametrize("text_of", [_of_one_warp, _of_two_warps, _of_groups])
def test_a_gpus_kernels_leave_no_quotient_and_no_root_to_the_assembler(text_of: Callable[[Kernel], str]) -> None:
    text = text_of(_kernel())
    assert "fdiv" not in text
    assert "@llvm.sqrt" not in text
    ptx = gpu_kernel.program(text, "This").ptx
    assert not {"div.rn.f32", "div.full.f32", "div.approx.f32", "rcp.rn.f32", "sqrt.rn.f32"} & set(ptx.split())
    assert {"rcp.approx.ftz.f32", "rsqrt.approx.ftz.f32", "sqrt.approx.ftz.f32"} <= set(ptx.split())


def test_a_processors_kernels_divide_and_take_roots_by_their_own_instructions() -> None:
    kernel = _kernel()
    text = host_kernel.text(kernel.results, kernel.read, 8)
    assert text.count("fdiv <8 x float>") == 2
    assert "@llvm.sqrt.v8f32(" in text
    assert "approx" not in text


def test_a_long_kernel_of_one_warp_leaves_quotients_and_roots_to_the_assembler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gpu_kernel, "SMALL", 1)
    text = _of_one_warp(_kernel())
    assert text.count("fdiv float") == 2
    assert "approx" not in text
    assert "approx" in _of_two_warps(_kernel())
