"""Scalar expressions as LLVM instructions on vectors: one vector lane per element of the batch.

The instructions are the same for processors and GPUs, where a thread is one lane; only quotients and roots are made of
others there (`gpu_instructions`, which says where these differ). Each is exactly rounded IEEE arithmetic. Which
products are fused with a sum has been decided before (`scalarize.fused`), not by LLVM. So bits do not depend on the
number of lanes, the machine or LLVM's version.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from evoclaims.kernels.trace.expressions import (
    FUSED,
    Choice,
    Chosen,
    Expression,
    Input,
    Loop,
    LoopResult,
    Number,
    ScalarOperation,
    Unsupported,
    everything,
    in_order,
    is_known,
)

LARGEST: Final = 200_000
"""Most operations in a kernel: LLVM compiles 50,000 in about 3 s, NVIDIA's driver in 10 s."""
TYPES: Final = {"f": "float", "i": "i32", "b": "i1"}
"""By the kind of dtype."""
STORED: Final = {"f": "float", "i": "i32", "b": "i8"}
BYTES: Final = {"f": 4, "i": 4, "b": 1}
"""In memory."""
SUFFIXES: Final = {"f": "f32", "i": "i32", "b": "i8"}
"""Of intrinsic functions, as types are in memory."""
BINARY: Final = {
    "f": {"add": "fadd", "div": "fdiv", "mul": "fmul", "sub": "fsub"},
    "i": {
        "add": "add",
        "and": "and",
        "div": "sdiv",
        "mul": "mul",
        "or": "or",
        "rem": "srem",
        "shift_left": "shl",
        "shift_right_arithmetic": "ashr",
        "shift_right_logical": "lshr",
        "sub": "sub",
        "xor": "xor",
    },
    "b": {"and": "and", "or": "or", "xor": "xor"},
}
_ORDERS: Final = ("ge", "gt", "le", "lt")
COMPARED: Final = {
    "f": {"eq": "fcmp oeq", "ne": "fcmp une"} | {name: f"fcmp o{name}" for name in _ORDERS},
    "i": {"eq": "icmp eq", "ne": "icmp ne"} | {name: f"icmp s{name}" for name in _ORDERS},
    "b": {"eq": "icmp eq", "ne": "icmp ne"},
}
"""NaN is unequal to everything; the other comparisons with it are false."""
INTRINSICS: Final = {
    "f": {
        "abs": "fabs",
        "ceil": "ceil",
        "floor": "floor",
        "max": "maximum",  # NaN if an operand is
        "min": "minimum",
        "rint": "roundeven",
        "sqrt": "sqrt",
    },
    "i": {"max": "smax", "min": "smin"},
    "b": {},
}
CASTS: Final = {"bf": "uitofp", "bi": "zext", "if": "sitofp"}
OTHERS: Final = {
    "f": ("bits", "cast", *FUSED, "neg", "select"),
    "i": ("abs", "bits", "cast", "neg", "not", "select"),
    "b": ("cast", "not", "seldom"),
}


@dataclass(frozen=True)
class ArrayRow:
    """A row of an array that a kernel reads: what one element of the batch has of it.

    Attributes:
        size: numbers in a row.
        kind: of their dtype.
    """

    size: int
    kind: str


def check(results: Iterable[Number]) -> None:
    """Check that every operation has an instruction, and that compiling takes at most about a minute.

    Raises:
        Unsupported: when one has none, or there are more than `LARGEST` operations.
    """
    expressions = everything(results)
    if len(expressions) > LARGEST:
        raise Unsupported(f"its {len(expressions):,} operations ({LARGEST:,} at most)")
    for operation in expressions:
        if isinstance(operation, ScalarOperation):
            kind, name = operation.operands[-1].dtype.kind, operation.name
            if not any(name in table[kind] for table in (BINARY, COMPARED, INTRINSICS, OTHERS)):
                raise Unsupported(f'"{name}" of {operation.operands[-1].dtype}')


def literal(number: Number) -> str:
    """Return a known number as LLVM writes it: floats as the bits of the equal double."""
    if number.dtype.kind == "f":
        return f"0x{struct.unpack('>Q', struct.pack('>d', float(number)))[0]:016X}"
    return str(int(number)) if number.dtype.kind == "i" else str(bool(number)).lower()


def of_literal(text: str) -> float:
    """Return the float that a literal says."""
    return float(struct.unpack(">d", bytes.fromhex(text.removeprefix("0x")))[0])


WEIGHTS: Final = '!0 = !{!"branch_weights", i32 1, i32 1000}'
"""How often the whole way is taken, and the short one, so that registers are kept for the latter."""
Loader = Callable[[Input], str]
"""Returns the register with an input number."""


class Instructions:
    """The instructions written so far.

    Attributes:
        lanes: elements of the batch that an instruction computes.
        lines: the instructions.
        declared: declarations of the intrinsic functions used.
        block: the basic block that is being written.
    """

    def __init__(self, lanes: int) -> None:
        """Start empty."""
        self.lanes = lanes
        self.lines: list[str] = []
        self.declared: dict[str, None] = {}
        self.block = ""
        self._registers = 0
        self._loops = 0
        self._branches = 0

    def register(self) -> str:
        """Return a new register."""
        self._registers += 1
        return f"%v{self._registers}"

    def write(self, *lines: str) -> None:
        """Add instructions without a result."""
        self.lines += lines

    def put(self, instruction: str) -> str:
        """Add an instruction; return the register with its result."""
        register = self.register()
        self.lines.append(f"{register} = {instruction}")
        return register

    def allocate(self, type_: str, count: int, alignment: int) -> str:
        """Return the address of fresh memory of this call; to be used before any loop."""
        register = self.register()
        self.lines.insert(1, f"{register} = alloca {type_}, i32 {count}, align {alignment}")  # after the first label
        return register

    def label(self, name: str) -> None:
        """Begin a basic block."""
        self.lines.append(f"{name}:")
        self.block = name

    def vector(self, type_: str) -> str:
        """Return the type of a vector of lanes; with one lane, of the number itself."""
        return type_ if self.lanes == 1 else f"<{self.lanes} x {type_}>"

    def call(self, name: str, returns: str, operands: Sequence[tuple[str, str]], flags: str = "") -> str:
        """Call an intrinsic function with (type, value) operands; return the result's register."""
        self.declared[f"declare {returns} @{name}({', '.join(type_ for type_, _ in operands)})"] = None
        given = f"{returns} @{name}({', '.join(f'{type_} {value}' for type_, value in operands)})"
        if returns == "void":
            self.write(f"call {given}")
            return ""
        return self.put(f"call {flags}{given}")

    def mangled(self, name: str, *suffixes: str) -> str:
        """Return an intrinsic function's name for vectors of lanes of these types."""
        return ".".join(["llvm", name, *(s if self.lanes == 1 else f"v{self.lanes}{s}" for s in suffixes)])

    def splat(self, type_: str, value: str) -> str:
        """Return a constant in all lanes."""
        return value if self.lanes == 1 else f"splat ({type_} {value})"

    def numbers_of_lanes(self) -> str:
        """Return the vector of the lanes' numbers, 0, 1, …, as i32."""
        return f"<{', '.join(f'i32 {lane}' for lane in range(self.lanes))}>"

    def in_all_lanes(self, type_: str, value: str) -> str:
        """Copy a number into all lanes."""
        if self.lanes == 1:
            return value
        vector = self.vector(type_)
        one = self.put(f"insertelement {vector} poison, {type_} {value}, i64 0")
        return self.put(f"shufflevector {vector} {one}, {vector} poison, <{self.lanes} x i32> zeroinitializer")

    def operand(self, number: Number, registers: dict[int, Any]) -> str:
        """Return a number's register, or its literal if it is known."""
        if is_known(number):
            return self.splat(TYPES[number.dtype.kind], literal(number))
        return str(registers[id(number)])

    def compute(self, expressions: Iterable[Expression], registers: dict[int, Any], load: Loader) -> None:
        """Compute expressions in order; `registers` has each one's register by its id."""
        for expression in expressions:
            if id(expression) in registers:
                continue
            match expression:
                case Input():
                    place = load(expression)
                case LoopResult(loop=around):
                    if id(around) not in registers:
                        registers[id(around)] = self._repeat(around, registers, load)
                    place = registers[id(around)][expression.place]
                case Chosen(choice=choice):
                    if id(choice) not in registers:
                        registers[id(choice)] = self._choose(choice, registers, load)
                    place = registers[id(choice)][expression.place]
                case ScalarOperation():
                    place = self._operate(expression, registers)
                case _:
                    raise AssertionError(f"a number of no loop around: {expression}")
            registers[id(expression)] = place

    def _operate(self, operation: ScalarOperation, registers: dict[int, Any]) -> str:
        """Write one operation."""
        operands = [self.operand(o, registers) for o in operation.operands]
        return self.operate(operation.name, operation.operands[-1].dtype.kind, operation.dtype.kind, operands)

    def operate(self, name: str, kind: str, made: str, operands: Sequence[str]) -> str:
        """Write an operation of this name; `kind` is that of the last operand's dtype, `made` of the result's."""
        type_ = self.vector(TYPES[kind])
        if name == "seldom":
            return operands[0]
        if name in FUSED:
            return self._fused(name, *operands)
        if (kind, name) == ("f", "div"):
            return self.divided(operands[0], operands[1])
        if (kind, name) == ("f", "sqrt"):
            return self.root(operands[0])
        if name in BINARY[kind]:
            return self.put(f"{BINARY[kind][name]} {type_} {operands[0]}, {operands[1]}")
        if name in COMPARED[kind]:
            return self.put(f"{COMPARED[kind][name]} {type_} {operands[0]}, {operands[1]}")
        if name in INTRINSICS[kind]:
            flags = "nsz " if name in ("max", "min") and kind == "f" else ""  # a zero's sign is not kept track of
            called = self.mangled(INTRINSICS[kind][name], SUFFIXES[kind])
            return self.call(called, type_, [(type_, o) for o in operands], flags)
        if name == "select":
            return self.put(f"select {self.vector('i1')} {operands[0]}, {type_} {operands[1]}, {type_} {operands[2]}")
        if name == "not":
            return self.put(f"xor {type_} {operands[0]}, {self.splat(TYPES[kind], '-1' if kind == 'i' else 'true')}")
        if name == "neg":
            minus = f"sub {type_} {self.splat('i32', '0')}," if kind == "i" else f"fneg {type_}"
            return self.put(f"{minus} {operands[0]}")
        if name == "abs":
            return self.call(self.mangled("abs", "i32"), type_, [(type_, operands[0]), ("i1", "false")])
        to = self.vector(TYPES[made])
        if name == "bits":
            return self.put(f"bitcast {type_} {operands[0]} to {to}")
        if kind == "f":
            return self._truncated(operands[0])
        return self.put(f"{CASTS[kind + made]} {type_} {operands[0]} to {to}")

    def divided(self, dividend: str, divisor: str) -> str:
        """Write an exactly rounded quotient of floats; return its register."""
        return self.put(f"{BINARY['f']['div']} {self.vector('float')} {dividend}, {divisor}")

    def root(self, number: str) -> str:
        """Write an exactly rounded square root of a float; return its register."""
        type_ = self.vector("float")
        return self.call(self.mangled(INTRINSICS["f"]["sqrt"], "f32"), type_, [(type_, number)])

    def _truncated(self, number: str) -> str:
        """Write a float as an integer: no overflow, and NaN is 0."""
        type_, to = self.vector("float"), self.vector("i32")
        if self.lanes == 1:
            return self.call(self.mangled("fptosi.sat", "i32", "f32"), to, [(type_, number)])
        # LLVM would write that lane by lane.
        beyond, condition = self.splat("float", literal(np.float32(2**31))), self.vector("i1")
        size = self.call(self.mangled("fabs", "f32"), type_, [(type_, number)])
        fits = self.put(f"fcmp olt {type_} {size}, {beyond}")
        safe = self.put(f"select {condition} {fits}, {type_} {number}, {type_} zeroinitializer")
        high, low = (self.put(f"fcmp {order} {type_} {number}, zeroinitializer") for order in ("ogt", "olt"))
        limit = self.put(f"select {condition} {low}, {to} {self.splat('i32', str(-(2**31)))}, {to} zeroinitializer")
        limit = self.put(f"select {condition} {high}, {to} {self.splat('i32', str(2**31 - 1))}, {to} {limit}")
        return self.put(f"select {condition} {fits}, {to} {self.put(f'fptosi {type_} {safe} to {to}')}, {to} {limit}")

    def _fused(self, name: str, c: str, a: str, b: str) -> str:
        """Write a sum or difference of a number and a product, rounded once."""
        type_ = self.vector("float")
        if name == "fms":
            c = self.put(f"fneg {type_} {c}")
        elif name == "fnma":
            a = self.put(f"fneg {type_} {a}")
        return self.call(self.mangled("fma", "f32"), type_, [(type_, a), (type_, b), (type_, c)])

    def _repeat(self, loop: Loop, registers: dict[int, Any], load: Loader) -> list[str]:
        """Write a loop; return its results' registers."""
        self.compute(in_order(loop.taken), registers, load)
        self._loops += 1

        def body(carried: Sequence[str]) -> list[str]:
            inside = {**registers, **{id(c): register for c, register in zip(loop.carried, carried, strict=True)}}
            self.compute(in_order(loop.results), inside, load)
            return [self.operand(r, inside) for r in loop.results]

        types = [self.vector(TYPES[c.dtype.kind]) for c in loop.carried]
        start = [self.operand(s, registers) for s in loop.start]
        return self.repeat(f"{{}}{self._loops}", loop.rounds, types, start, body)

    def repeat(
        self,
        names: str,
        rounds: int,
        types: Sequence[str],
        start: Sequence[str],
        body: Callable[[list[str]], list[str]],
    ) -> list[str]:
        """Write a loop; `body` writes a round, from the registers of what is carried to those of what is carried on.

        The names of blocks have {} for what each is. Returned are the registers of what the last round carries on.
        """
        before, again, after = self.block, names.format("again"), names.format("after")
        self.write(f"br label %{again}")
        self.label(again)
        head = len(self.lines)
        carried, number = [self.register() for _ in types], self.register()
        results = body(carried)
        following = self.put(f"add i32 {number}, 1")
        self.lines[head:head] = [
            either(register, type_, (first, before), (result, self.block))
            for register, type_, first, result in zip(
                [*carried, number], [*types, "i32"], [*start, "0"], [*results, following], strict=True
            )
        ]
        more = self.put(f"icmp ult i32 {following}, {rounds}")
        self.write(f"br i1 {more}, label %{again}, label %{after}")
        self.label(after)
        return results

    def _choose(self, choice: Choice, registers: dict[int, Any], load: Loader) -> list[str]:
        """Write both ways of a choice; return the results' registers."""
        self._branches += 1

        def way(numbers: Sequence[Number]) -> list[str]:
            inside = dict(registers)
            self.compute(in_order(numbers), inside, load)
            return [self.operand(n, inside) for n in numbers]

        condition = self.in_any_lane(self.operand(choice.condition, registers))
        types = [self.vector(TYPES[n.dtype.kind]) for n in choice.whole]
        return self.choose(f"{{}}{self._branches}", choice, condition, types, way)

    def choose(
        self, names: str, choice: Choice, condition: str, types: Sequence[str], way: Callable[..., list[str]]
    ) -> list[str]:
        """Write both ways of a choice, each by `way`, from numbers to registers; for `names` see `repeat`."""
        whole, short, end = map(names.format, ("whole", "short", "end"))
        self.declared[WEIGHTS] = None
        self.write(f"br i1 {condition}, label %{whole}, label %{short}, !prof !0")
        ways = []
        for name, numbers in ((whole, choice.whole), (short, choice.short)):
            self.label(name)
            ways.append([(value, self.block) for value in way(numbers)])
            self.write(f"br label %{end}")
        self.label(end)
        results = [self.register() for _ in types]
        self.lines += [either(*one) for one in zip(results, types, *ways, strict=True)]
        return results

    def in_any_lane(self, condition: str) -> str:
        """Return whether a condition is true in any lane."""
        if self.lanes == 1:
            return condition
        return self.call(f"llvm.vector.reduce.or.v{self.lanes}i1", "i1", [(self.vector("i1"), condition)])


def either(register: str, type_: str, *sources: tuple[str, str]) -> str:
    """Return the instruction that takes the value of the block it was reached from; sources are (value, block)."""
    return f"{register} = phi {type_} {', '.join(f'[ {value}, %{block} ]' for value, block in sources)}"
