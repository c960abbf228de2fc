"""Scalar expressions as PTX, the assembly language of NVIDIA GPUs (PTX ISA 7.1); a thread computes all results once."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from evoclaims.kernels.expressions import (
    Carried,
    Expression,
    Input,
    Loop,
    LoopResult,
    Number,
    ScalarOperation,
    in_order,
    is_known,
)
from evoclaims.kernels.interpreter import Numbers
from evoclaims.kernels.unsupported import Unsupported

ENTRY: Final = "kernel"
HEAD: Final = ".version 7.1\n.target sm_80\n.address_size 64\n"
LARGEST: Final = 200_000
"""Most expressions in a kernel: the driver assembles 50,000 in about 10 s."""
CAPABILITY: Final = 8.0
"""The compute capability needed, for `max.NaN` and `min.NaN`."""
COMPARED: Final = {name: f"setp.{name}" for name in ("eq", "ge", "gt", "le", "lt")}
# The assembler may fuse a product and a following sum, which is faster and more exact.
FLOATS: Final = {name: f"{code}.f32" for name, code in COMPARED.items()} | {
    "abs": "abs.f32",
    "add": "add.f32",
    "ceil": "cvt.rpi.f32.f32",
    "div": "div.rn.f32",
    "floor": "cvt.rmi.f32.f32",
    "max": "max.NaN.f32",
    "min": "min.NaN.f32",
    "mul": "mul.f32",
    "ne": "setp.neu.f32",  # true for NaN; the other comparisons are false
    "neg": "neg.f32",
    "rint": "cvt.rni.f32.f32",
    "select": "selp.f32",
    "sqrt": "sqrt.rn.f32",
    "sub": "sub.f32",
}
INTEGERS: Final = {name: f"{code}.s32" for name, code in COMPARED.items()} | {
    "abs": "abs.s32",
    "add": "add.s32",
    "and": "and.b32",
    "div": "div.s32",
    "max": "max.s32",
    "min": "min.s32",
    "mul": "mul.lo.s32",
    "ne": "setp.ne.s32",
    "neg": "neg.s32",
    "not": "not.b32",
    "or": "or.b32",
    "rem": "rem.s32",
    "select": "selp.s32",
    "sub": "sub.s32",
    "xor": "xor.b32",
}
CONDITIONS: Final = {"and": "and.pred", "ne": "xor.pred", "not": "not.pred", "or": "or.pred", "xor": "xor.pred"}
INSTRUCTIONS: Final = {"f": FLOATS, "i": INTEGERS, "b": CONDITIONS}
"""Instructions by the kind of the last operand's dtype, then by operation."""
CASTS: Final = {"if": "cvt.rn.f32.s32", "fi": "cvt.rzi.s32.f32"}
TYPES: Final = {"f": "f32", "i": "s32", "b": "pred"}
NAMES: Final = {"f": "%f", "i": "%r", "b": "%p"}
BYTES: Final = {"f": 4, "i": 4, "b": 1}


@dataclass(frozen=True)
class Array:
    """The memory layout of a kernel's input array, row by row.

    Attributes:
        size: numbers in a row.
        dtype: float32, int32 or bool.
        shared_by: how many consecutive threads read the same row.
    """

    size: int
    dtype: np.dtype[Any]
    shared_by: int = 1


def arrays_read(results: Sequence[Numbers]) -> list[int]:
    """Return which input arrays the results depend on."""
    return sorted({e.array for e in _everything(_numbers(results)) if isinstance(e, Input)})


def check_results(results: Sequence[Numbers]) -> None:
    """Check that every operation has an instruction, and that assembling takes at most about a minute.

    Raises:
        Unsupported: when one has none, or there are more than `LARGEST` operations.
    """
    everything = _everything(_numbers(results))
    if len(everything) > LARGEST:
        raise Unsupported(f"its {len(everything):,} operations ({LARGEST:,} at most)")
    for operation in everything:
        if isinstance(operation, ScalarOperation):
            kind, name = operation.operands[-1].dtype.kind, operation.name
            if name not in ("cast", *INSTRUCTIONS[kind]) and (kind, name) != ("b", "eq"):
                raise Unsupported(f'"{name}" of {operation.operands[-1].dtype}')


def kernel(results: Sequence[Numbers], arrays: dict[int, Array], threads: int, block: int) -> str:
    """Return the PTX of a kernel.

    Args:
        results: what a thread writes into its row of each result, none of them empty.
        arrays: the inputs read (`arrays_read`); the kernel's parameters are their addresses, then the results'.
        threads: number of rows.
        block: threads in a block.
    """
    page = _Assembly()
    page.write("mov.u32 %row, %ctaid.x", "mov.u32 %in_block, %tid.x", f"mad.lo.u32 %row, %row, {block}, %in_block")
    page.write(f"setp.ge.u32 %none, %row, {threads}", "@%none bra done")
    for parameter, array in arrays.items():
        page.find(f"%a{parameter}", f"a{parameter}", array)
    registers: dict[int, str | list[str]] = {}
    page.compute(in_order(_numbers(results)), registers)
    for place, result in enumerate(results):
        dtype = result.flat[0].dtype
        page.find(f"%z{place}", f"z{place}", Array(result.size, dtype))
        for i, number in enumerate(result.flat):
            page.store(f"[%z{place}+{i * BYTES[dtype.kind]}]", number, registers)
    parameters = [f".param .u64 a{p}" for p in arrays] + [f".param .u64 z{p}" for p in range(len(results))]
    addresses = [f"%a{p}" for p in arrays] + [f"%z{p}" for p in range(len(results))]
    declared = [".reg .u32 %row, %in_block, %shared", ".reg .pred %none", f".reg .u64 {', '.join(addresses)}"]
    declared += [f".reg .{TYPES[k]} {NAMES[k]}<{count}>" for k, count in page.count.items() if count]
    body = ";\n".join([*declared, *page.lines]).replace(":;", ":")
    opening = f".visible .entry {ENTRY}({', '.join(parameters)})\n.maxntid {block}, 1, 1\n{{\n"
    return f"{HEAD}{opening}{body};\ndone:\nret;\n}}\n"


def _numbers(results: Sequence[Numbers]) -> list[Number]:
    """Return all numbers of arrays."""
    return [number for result in results for number in result.flat]


def _everything(numbers: Iterable[Number]) -> list[Expression]:
    """Return these and all expressions they use, including loop bodies."""
    order = in_order(numbers)
    loops = {id(e.loop): e.loop for e in order if isinstance(e, LoopResult)}
    return order + [inner for loop in loops.values() for inner in _everything(loop.results)]


class _Assembly:
    """The instructions written so far. Every register is written once, except those that loops carry."""

    def __init__(self) -> None:
        """Start empty."""
        self.lines: list[str] = []
        self.count = dict.fromkeys(TYPES, 0)
        self.labels = 0

    def write(self, *lines: str) -> None:
        """Add instructions."""
        self.lines += lines

    def register(self, dtype: Any) -> str:
        """Return a new register."""
        kind = np.dtype(dtype).kind
        self.count[kind] += 1
        return f"{NAMES[kind]}{self.count[kind] - 1}"

    def find(self, address: str, parameter: str, array: Array) -> None:
        """Put the address of the thread's row of an array into a register."""
        self.write(f"ld.param.u64 {address}, [{parameter}]", f"cvta.to.global.u64 {address}, {address}")
        row = "%row"
        if array.shared_by > 1:
            self.write(f"div.u32 %shared, %row, {array.shared_by}")
            row = "%shared"
        self.write(f"mad.wide.u32 {address}, {row}, {array.size * BYTES[array.dtype.kind]}, {address}")

    def compute(self, expressions: Sequence[Expression], registers: dict[int, Any]) -> None:
        """Compute expressions in order; `registers` has each one's register by its id."""
        for expression in expressions:
            if id(expression) in registers:
                continue
            match expression:
                case Input():
                    place = self._load(expression)
                case LoopResult():
                    around = expression.loop
                    if id(around) not in registers:
                        registers[id(around)] = self._repeat(around, registers)
                    place = registers[id(around)][expression.place]
                case ScalarOperation():
                    operands = [self.operand(o, registers) for o in expression.operands]
                    place = self.register(expression.dtype)
                    self._operate(expression, place, operands)
                case _:
                    raise AssertionError(f"a number of no loop around: {expression}")
            registers[id(expression)] = place

    def operand(self, number: Number, registers: dict[int, Any]) -> str:
        """Return a number's register, or its literal if it is known."""
        if not is_known(number):
            return str(registers[id(number)])
        if number.dtype.kind == "f":
            return f"0f{struct.unpack('>I', struct.pack('>f', float(number)))[0]:08X}"
        if number.dtype.kind == "i":
            return str(int(number))
        condition = self.register(bool)
        self.write(f"setp.ne.s32 {condition}, {int(number)}, 0")
        return condition

    def store(self, to: str, number: Number, registers: dict[int, Any]) -> None:
        """Write a number to memory."""
        value, kind = self.operand(number, registers), number.dtype.kind
        if kind == "b" or is_known(number):
            held = self.register(np.int32 if kind == "b" else number.dtype)
            self.write(f"selp.s32 {held}, 1, 0, {value}" if kind == "b" else f"mov.{TYPES[kind]} {held}, {value}")
            value = held
        self.write(f"st.global.{'u8' if kind == 'b' else TYPES[kind]} {to}, {value}")

    def _load(self, number: Input) -> str:
        """Read a number from memory."""
        kind, place = number.dtype.kind, self.register(number.dtype)
        address = f"[%a{number.array}+{number.place * BYTES[kind]}]"
        if kind == "b":
            byte = self.register(np.int32)
            self.write(f"ld.global.u8 {byte}, {address}", f"setp.ne.s32 {place}, {byte}, 0")
        else:
            self.write(f"ld.global.{TYPES[kind]} {place}, {address}")
        return place

    def _operate(self, operation: ScalarOperation, place: str, operands: list[str]) -> None:
        """Write one operation."""
        kind = operation.operands[-1].dtype.kind
        if operation.name == "cast":
            to = operation.dtype.kind
            one, zero = ("0f3F800000", "0f00000000") if to == "f" else ("1", "0")
            self.write(
                f"selp.{TYPES[to]} {place}, {one}, {zero}, {operands[0]}"
                if kind == "b"
                else f"{CASTS[kind + to]} {place}, {operands[0]}"
            )
        elif operation.name == "select":
            condition, yes, no = operands
            self.write(f"{INSTRUCTIONS[kind]['select']} {place}, {yes}, {no}, {condition}")
        elif operation.name == "eq" and kind == "b":
            unequal = self.register(bool)
            self.write(f"xor.pred {unequal}, {operands[0]}, {operands[1]}", f"not.pred {place}, {unequal}")
        else:
            self.write(f"{INSTRUCTIONS[kind][operation.name]} {place}, {', '.join(operands)}")

    def _repeat(self, loop: Loop, registers: dict[int, Any]) -> list[str]:
        """Write a loop; return its results' registers."""

        def move(numbers: Iterable[tuple[str, str, Carried]]) -> None:
            self.write(*(f"mov.{TYPES[c.dtype.kind]} {to}, {source}" for to, source, c in numbers))

        carried = [self.register(c.dtype) for c in loop.carried]
        move(zip(carried, [self.operand(s, registers) for s in loop.start], loop.carried, strict=True))
        again, rounds, more = f"again{self.labels}", self.register(np.int32), self.register(bool)
        self.labels += 1
        self.write(f"mov.s32 {rounds}, 0", f"{again}:")
        inside = {**registers, **{id(c): register for c, register in zip(loop.carried, carried, strict=True)}}
        self.compute(in_order(loop.results), inside)
        # A result may be another carried number: copy all before overwriting any.
        aside = [self.register(c.dtype) for c in loop.carried]
        move(zip(aside, [self.operand(r, inside) for r in loop.results], loop.carried, strict=True))
        move(zip(carried, aside, loop.carried, strict=True))
        self.write(
            f"add.s32 {rounds}, {rounds}, 1", f"setp.lt.s32 {more}, {rounds}, {loop.rounds}", f"@{more} bra {again}"
        )
        return carried
