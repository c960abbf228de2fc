"""What LLVM calls types and operations on numbers, and how it writes known numbers."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from evoclaims.kernels.trace.expressions import FUSED, Number, ScalarOperation, everything
from evoclaims.kernels.unsupported import Unsupported

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
