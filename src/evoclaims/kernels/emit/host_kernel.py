"""A kernel for the processor: LLVM's text of a loop over the batch.

A vector lane computes an element of the batch, as in ispc. Arrays are stored element by element, so that lanes gather
their numbers and scatter their results.

XLA's foreign function interface is a stable ABI (`c_api.h` of jaxlib): the handler written here takes the arrays'
addresses out of the call frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from evoclaims.kernels.emit.llvm_ir import BYTES, STORED, SUFFIXES, ArrayRow, Instructions
from evoclaims.kernels.trace.expressions import Input, in_order
from evoclaims.kernels.trace.interpreter import Numbers

ENTRY: Final = "handler"
"""The symbol that XLA calls."""
EXTENSION_START, API, ARGUMENTS, RESULTS = 8, 16, 72, 112
"""Offsets, in bytes, in XLA_FFI_CallFrame: the extensions, the API, the arrays of pointers to buffers."""
DATA: Final = 24
"""Offset of the address of the data in XLA_FFI_Buffer."""
METADATA: Final = 24
"""Offset of the address of XLA_FFI_Metadata in the extension that asks for it."""
API_VERSION: Final = 32
"""Offset of the version (major, minor) in XLA_FFI_Api."""
METADATA_VERSION: Final = 24
"""Offset of the version (major, minor) in XLA_FFI_Metadata."""


def handler(counts: int, arrays: int, results: int) -> str:
    """Return the text of the function that XLA calls.

    It calls the function `work` with the numbers of the first argument, an array of `counts` int32, as i64; then with
    the addresses of the other arguments and of the results.
    """
    lines = [
        f"define ptr @{ENTRY}(ptr %frame) nounwind {{",
        "entry:",
        *_loaded("%extension", "ptr", "%frame", EXTENSION_START),
        *_loaded("%api", "ptr", "%frame", API),
        "%called = icmp eq ptr %extension, null",
        "br i1 %called, label %call, label %asked",
        "asked:",  # XLA asks which version of the interface this is: the fields read here are in all of them
        *_loaded("%metadata", "ptr", "%extension", METADATA),
        *_loaded("%version", "i64", "%api", API_VERSION),
        f"%answer = getelementptr i8, ptr %metadata, i64 {METADATA_VERSION}",
        "store i64 %version, ptr %answer",
        "ret ptr null",
        "call:",
        *_loaded("%arguments", "ptr", "%frame", ARGUMENTS),
        *_loaded("%results", "ptr", "%frame", RESULTS),
        *_buffer("%layout", "%arguments", 0),
    ]
    for place in range(counts):
        lines += [
            *_loaded(f"%n{place}.short", "i32", "%layout", 4 * place),
            f"%n{place} = zext i32 %n{place}.short to i64",
        ]
    for place in range(arrays):
        lines += _buffer(f"%a{place}", "%arguments", 1 + place)
    for place in range(results):
        lines += _buffer(f"%z{place}", "%results", place)
    given = [f"i64 %n{place}" for place in range(counts)]
    given += [f"ptr %a{place}" for place in range(arrays)] + [f"ptr %z{place}" for place in range(results)]
    lines += [f"call void @work({', '.join(given)})", "ret ptr null", "}"]
    return "\n".join(lines) + "\n"


def _loaded(register: str, type_: str, address: str, offset: int) -> list[str]:
    """Return instructions that read a field of a struct."""
    at = f"{register}.at"
    return [f"{at} = getelementptr i8, ptr {address}, i64 {offset}", f"{register} = load {type_}, ptr {at}"]


def _buffer(register: str, buffers: str, place: int) -> list[str]:
    """Return instructions that read the address of the data of a buffer."""
    return [
        *_loaded(f"{register}.buffer", "ptr", buffers, 8 * place),
        *_loaded(register, "ptr", f"{register}.buffer", DATA),
    ]


WIDE: Final = 'nounwind "prefer-vector-width"="512" "min-legal-vector-width"="512"'
"""Attributes of a function that uses the widest vectors there are."""


def text(results: Sequence[Numbers], arrays: Mapping[int, ArrayRow], lanes: int) -> str:
    """Return the text of a kernel.

    Its arguments are an array of int32, [rows of the batch, and of each array read how many consecutive rows share one
    of its rows], and the arrays read; its results are what `results` says, row by row.

    Args:
        results: what is computed for an element, none of them empty.
        arrays: the rows of the arrays read, in order.
        lanes: elements computed at a time.
    """
    page = Instructions(lanes)
    _block(page, results, arrays)
    given = [f"i64 %shared{a}" for a in arrays]
    given += [f"ptr %a{a}" for a in arrays] + [f"ptr %z{z}" for z in range(len(results))]
    body = "\n".join(page.lines)
    block = f"define internal void @block({', '.join([*given, 'i64 %row', 'i64 %last'])}) {WIDE} {{\n{body}\n}}\n"
    called = handler(1 + len(arrays), len(arrays), len(results))
    return "\n".join(page.declared) + "\n" + block + _loop(given, lanes) + called


def _block(page: Instructions, results: Sequence[Numbers], arrays: Mapping[int, ArrayRow]) -> None:
    """Write the computation of rows `row`, `row` + 1, … to at most `last`, one per lane.

    Lanes beyond `last` compute the last row, and store the same as the lane of that.
    """
    lanes, integers, pointers = page.lanes, page.vector("i32"), page.vector("ptr")
    page.label("entry")
    # Memory of unknown size (none) on the stack makes LLVM find what does not fit the registers by a base pointer. By
    # x86's stack pointer each such instruction is a byte longer, and some processors decode few of nine bytes.
    page.put(f"alloca {integers}, i64 {page.put('and i64 %row, 0')}, align {4 * lanes}")
    left = page.put("sub i64 %last, %row")
    few = page.call("llvm.umin.i64", "i64", [("i64", left), ("i64", str(lanes - 1))])
    last = page.in_all_lanes("i32", page.put(f"trunc i64 {few} to i32"))
    lane = page.call(page.mangled("umin", "i32"), integers, [(integers, page.numbers_of_lanes()), (integers, last)])
    rows = {array: _rows(page, array, row, lane) for array, row in arrays.items()}
    everywhere = page.splat("i1", "true")

    def load(number: Input) -> str:
        kind = number.dtype.kind
        stored = page.vector(STORED[kind])
        where = (pointers, _addresses(page, *rows[number.array], number.place, kind))
        others = ("i32", str(BYTES[kind])), (page.vector("i1"), everywhere), (stored, "poison")
        value = page.call(page.mangled("masked.gather", SUFFIXES[kind], "p0"), stored, [where, *others])
        return page.put(f"icmp ne {stored} {value}, zeroinitializer") if kind == "b" else value

    registers: dict[int, str] = {}
    page.compute(in_order([number for result in results for number in result.flat]), registers, load)
    for place, result in enumerate(results):
        kind = result.flat[0].dtype.kind
        stored = page.vector(STORED[kind])
        begin = page.put(f"mul i64 %row, {result.size}")
        address = page.put(f"getelementptr {STORED[kind]}, ptr %z{place}, i64 {begin}")
        offsets = page.put(f"mul {integers} {lane}, {page.splat('i32', str(result.size))}")
        scatter = page.mangled("masked.scatter", SUFFIXES[kind], "p0")
        for at, number in enumerate(result.flat):
            value = page.operand(number, registers)
            if kind == "b":
                value = page.put(f"zext {page.vector('i1')} {value} to {stored}")
            where = _addresses(page, address, offsets, at, kind)
            others = ("i32", str(BYTES[kind])), (page.vector("i1"), everywhere)
            page.call(scatter, "void", [(stored, value), (pointers, where), *others])
    page.write("ret void")


def _rows(page: Instructions, array: int, row: ArrayRow, lane: str) -> tuple[str, str]:
    """Return registers: the address of the first lane's row of an array, and each lane's offset from it, in numbers."""
    first = page.put(f"udiv i64 %row, %shared{array}")
    skipped = page.put(f"urem i64 %row, %shared{array}")
    begin = page.put(f"mul i64 {first}, {row.size}")
    address = page.put(f"getelementptr {STORED[row.kind]}, ptr %a{array}, i64 {begin}")
    # Whole numbers below 2³² are exact as doubles, and so is the whole part of their quotient. Processors divide
    # vectors of doubles, but not of integers.
    doubles, integers = page.vector("double"), page.vector("i32")
    before = page.in_all_lanes("double", page.put(f"uitofp i64 {skipped} to double"))
    shared = page.in_all_lanes("double", page.put(f"uitofp i64 %shared{array} to double"))
    place = page.put(f"fadd {doubles} {page.put(f'uitofp {integers} {lane} to {doubles}')}, {before}")
    further = page.put(f"fptosi {doubles} {page.put(f'fdiv {doubles} {place}, {shared}')} to {integers}")
    return address, page.put(f"mul {integers} {further}, {page.splat('i32', str(row.size))}")


def _addresses(page: Instructions, address: str, offsets: str, place: int, kind: str) -> str:
    """Return a register with each lane's address of the number at `place` in its row."""
    base = page.put(f"getelementptr {STORED[kind]}, ptr {address}, i64 {place}")
    return page.put(f"getelementptr {STORED[kind]}, ptr {base}, {page.vector('i32')} {offsets}")


def _loop(given: Sequence[str], lanes: int) -> str:
    """Return the text of the loop over the batch; `given` are the parameters of `block` besides its rows."""
    lines = [
        f"define internal void @work({', '.join(['i64 %rows', *given])}) nounwind {{",
        "entry:",
        "%last = sub i64 %rows, 1",
        "br label %again",
        "again:",
        "%row = phi i64 [ 0, %entry ], [ %following, %again ]",
        f"call void @block({', '.join([*given, 'i64 %row', 'i64 %last'])})",
        f"%following = add i64 %row, {lanes}",
        "%more = icmp ult i64 %following, %rows",
        "br i1 %more, label %again, label %done",
        "done:",
        "ret void",
        "}",
    ]
    return "\n".join(lines) + "\n"
