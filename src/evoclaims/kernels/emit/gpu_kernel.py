"""A kernel for NVIDIA's GPUs: a thread computes an element of the batch; LLVM writes the PTX."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from evoclaims.kernels.emit.gpu_instructions import GpuInstructions
from evoclaims.kernels.emit.llvm_ir import BYTES, STORED, ArrayRow, Instructions
from evoclaims.kernels.emit.machine_code import llvm
from evoclaims.kernels.trace.expressions import Input, everything, in_order
from evoclaims.kernels.trace.interpreter import Numbers

ENTRY: Final = "kernel"
BLOCK: Final = 32
"""Threads in a block: one warp, so that even few elements use many processors."""
SMALL: Final = 8_000
"""Operations of a kernel whose code fits an instruction cache: a warp alone executes it as fast as several would."""
CAPABILITY: Final = 8.0
"""The compute capability needed; every GPU from there on runs what is written for it."""


def text(results: Sequence[Numbers], arrays: Mapping[int, ArrayRow], shared: Mapping[int, int], rows: int) -> str:
    """Return LLVM's text of a kernel; its parameters are the addresses of the arrays read, then of the results.

    Args:
        results: what is computed for an element, none of them empty.
        arrays: the rows of the arrays read, in order.
        shared: how many consecutive elements share a row of each.
        rows: elements of the batch.
    """
    numbers = [number for result in results for number in result.flat]
    # Without the branches of divisions, longer code would be one block, which NVIDIA's assembler orders for minutes
    # and spills more of.
    page = GpuInstructions(branches=len(everything(numbers)) > SMALL)
    element = Element(page, begin(page, rows), arrays, shared)
    registers: dict[int, str] = {}
    page.compute(in_order(numbers), registers, element.load)
    for z, result in enumerate(results):
        for at, number in enumerate(result.flat):
            element.store(page.operand(number, registers), number.dtype.kind, z, at, result.size)
    return finished(page, parameters(arrays, len(results)))


class Element:
    """A thread's element of the batch: how its numbers are read and written.

    Addresses are computed where they are first used; `forget` has them computed again, where they are not at hand.
    """

    def __init__(self, page: Instructions, row: str, arrays: Mapping[int, ArrayRow], shared: Mapping[int, int]) -> None:
        """Remember what `text` was given; `row` is the register with the element's number."""
        self._page = page
        self._row = row
        self._arrays = arrays
        self._shared = shared
        self._addresses: dict[str, str] = {}

    def forget(self) -> None:
        """Forget all addresses."""
        self._addresses.clear()

    def load(self, number: Input, place: str = "") -> str:
        """Return the register with a number that is read; `place`, an i32, replaces its place in the array."""
        kind, page, shared = number.dtype.kind, self._page, self._shared[number.array]
        address = self._address(f"%a{number.array}", self._arrays[number.array].size, kind, shared)
        at = f"i32 {place}" if place else f"i64 {number.place}"
        where = page.put(f"getelementptr {STORED[kind]}, ptr addrspace(1) {address}, {at}")
        value = page.put(f"load {STORED[kind]}, ptr addrspace(1) {where}, align {BYTES[kind]}")
        return page.put(f"icmp ne i8 {value}, 0") if kind == "b" else value

    def store(self, value: str, kind: str, result: int, at: int, size: int) -> None:
        """Write a number of a result that has `size`."""
        page = self._page
        address = self._address(f"%z{result}", size, kind, 1)
        where = page.put(f"getelementptr {STORED[kind]}, ptr addrspace(1) {address}, i64 {at}")
        if kind == "b":
            value = page.put(f"zext i1 {value} to i8")
        page.write(f"store {STORED[kind]} {value}, ptr addrspace(1) {where}, align {BYTES[kind]}")

    def _address(self, parameter: str, size: int, kind: str, shared: int) -> str:
        """Return the address of the element's row of an array."""
        if parameter not in self._addresses:
            page = self._page
            row = self._row if shared == 1 else page.put(f"udiv i32 {self._row}, {shared}")
            first = page.put(f"mul i64 {page.put(f'zext i32 {row} to i64')}, {size}")
            address = page.put(f"getelementptr {STORED[kind]}, ptr addrspace(1) {parameter}, i64 {first}")
            self._addresses[parameter] = address
        return self._addresses[parameter]


def parameters(arrays: Mapping[int, ArrayRow], results: int) -> list[str]:
    """Return the names of a kernel's parameters."""
    return [*(f"%a{a}" for a in arrays), *(f"%z{z}" for z in range(results))]


def begin(page: Instructions, threads: int) -> str:
    """Begin a kernel; return the register with the thread's number, which is below `threads`."""
    page.label("entry")
    block, thread = (page.call(f"llvm.nvvm.read.ptx.sreg.{name}.x", "i32", []) for name in ("ctaid", "tid"))
    first = page.put(f"mul i32 {block}, {BLOCK}")
    number = page.put(f"add i32 {first}, {thread}")
    inside = page.put(f"icmp ult i32 {number}, {threads}")
    page.write(f"br i1 {inside}, label %work, label %done")
    page.label("work")
    return number


def finished(page: Instructions, names: Sequence[str], warps: int = 1, teams: int = 1) -> str:
    """Return the text of a kernel that has begun; its parameters are addresses of these names.

    A block of several warps may have all registers of a processor: without `minctasm` the assembler keeps some free for
    a second block, and spills.
    """
    page.write("br label %done")
    page.label("done")
    page.write("ret void")
    given = ", ".join(f"ptr addrspace(1) {name}" for name in names)
    body = "\n".join(page.lines)
    attributes = f'nounwind "nvvm.maxntid"="{BLOCK},{warps},{teams}" "nvvm.minctasm"="1"'
    kernel = f"define ptx_kernel void @{ENTRY}({given}) {attributes} {{\n{body}\n}}\n"
    return 'target triple = "nvptx64-nvidia-cuda"\n' + "\n".join(page.declared) + "\n" + kernel


@dataclass(frozen=True)
class GpuProgram:
    """A kernel as NVIDIA's GPUs get it.

    Attributes:
        ptx: the assembly language of these GPUs.
        name: of the kernel in it, which profilers show.
        elements: of the batch that a block computes.
        warps: of a team.
        teams: of a block.
        shared_bytes: of a block's memory.
    """

    ptx: str
    name: str
    elements: int = BLOCK
    warps: int = 1
    teams: int = 1
    shared_bytes: int = 0


def program(
    text: str, name: str, elements: int = BLOCK, warps: int = 1, teams: int = 1, shared_bytes: int = 0
) -> GpuProgram:
    """Return LLVM's text of a kernel as a program; for the rest see `GpuProgram`."""
    symbol = re.sub(r"\W+", "_", name.lower(), flags=re.ASCII).strip("_")
    if not symbol[:1].isalpha():
        symbol = f"{ENTRY}_{symbol}"
    module = llvm.parse_assembly(text.replace(f"@{ENTRY}(", f"@{symbol}("))
    module.verify()
    return GpuProgram(str(_target().emit_assembly(module)), symbol, elements, warps, teams, shared_bytes)


@cache
def _target() -> Any:
    """Return the oldest GPU of `CAPABILITY`."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple("nvptx64-nvidia-cuda")
    return target.create_target_machine(f"sm_{round(CAPABILITY * 10)}", "+ptx71", 2)
