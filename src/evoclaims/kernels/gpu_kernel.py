"""A kernel for NVIDIA's GPUs: a thread computes an element of the batch; LLVM writes the PTX."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Final

from evoclaims.kernels.expressions import Input, in_order
from evoclaims.kernels.interpreter import Numbers
from evoclaims.kernels.llvm_ir import BYTES, STORED, Instructions, Row
from evoclaims.kernels.machine_code import llvm

ENTRY: Final = "kernel"
BLOCK: Final = 32
"""Threads in a block: one warp, so that even few elements use many processors."""
CAPABILITY: Final = 8.0
"""The compute capability needed; every GPU from there on runs what is written for it."""


def text(results: Sequence[Numbers], arrays: Mapping[int, Row], shared: Mapping[int, int], rows: int) -> str:
    """Return LLVM's text of a kernel; its parameters are the addresses of the arrays read, then of the results.

    Args:
        results: what is computed for an element, none of them empty.
        arrays: the rows of the arrays read, in order.
        shared: how many consecutive elements share a row of each.
        rows: elements of the batch.
    """
    page = Instructions(1, [number for result in results for number in result.flat])
    row = begin(page, rows)

    def place(parameter: str, row: str, size: int, kind: str) -> str:
        wide = page.put(f"zext i32 {row} to i64")
        first = page.put(f"mul i64 {wide}, {size}")
        return page.put(f"getelementptr {STORED[kind]}, ptr addrspace(1) {parameter}, i64 {first}")

    addresses: dict[int, str] = {}
    for array, of in arrays.items():
        own = row if shared[array] == 1 else page.put(f"udiv i32 {row}, {shared[array]}")
        addresses[array] = place(f"%a{array}", own, of.size, of.kind)

    def number_at(address: str, at: int, kind: str) -> str:
        return page.put(f"getelementptr {STORED[kind]}, ptr addrspace(1) {address}, i64 {at}")

    def load(number: Input) -> str:
        kind = number.dtype.kind
        where = number_at(addresses[number.array], number.place, kind)
        value = page.put(f"load {STORED[kind]}, ptr addrspace(1) {where}, align {BYTES[kind]}")
        return page.put(f"icmp ne i8 {value}, 0") if kind == "b" else value

    registers: dict[int, str] = {}
    page.compute(in_order([number for result in results for number in result.flat]), registers, load)
    for z, result in enumerate(results):
        kind = result.flat[0].dtype.kind
        address = place(f"%z{z}", row, result.size, kind)
        for at, number in enumerate(result.flat):
            value = page.operand(number, registers)
            if kind == "b":
                value = page.put(f"zext i1 {value} to i8")
            where = number_at(address, at, kind)
            page.write(f"store {STORED[kind]} {value}, ptr addrspace(1) {where}, align {BYTES[kind]}")
    return finished(page, [*(f"%a{a}" for a in arrays), *(f"%z{z}" for z in range(len(results)))])


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


def finished(page: Instructions, parameters: Sequence[str]) -> str:
    """Return the text of a kernel that has begun; its parameters are addresses."""
    page.write("br label %done")
    page.label("done")
    page.write("ret void")
    given = ", ".join(f"ptr addrspace(1) {name}" for name in parameters)
    body = "\n".join(page.lines)
    attributes = f'nounwind "nvvm.maxntid"="{BLOCK},1,1"'
    kernel = f"define ptx_kernel void @{ENTRY}({given}) {attributes} {{\n{body}\n}}\n"
    return 'target triple = "nvptx64-nvidia-cuda"\n' + "\n".join(page.declared) + "\n" + kernel


def ptx(text: str) -> str:
    """Return LLVM's text as PTX, the assembly language of NVIDIA's GPUs."""
    module = llvm.parse_assembly(text)
    module.verify()
    return str(_target().emit_assembly(module))


@cache
def _target() -> Any:
    """Return the oldest GPU of `CAPABILITY`."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple("nvptx64-nvidia-cuda")
    return target.create_target_machine(f"sm_{round(CAPABILITY * 10)}", "+ptx71", 2)
