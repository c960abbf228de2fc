"""Kernels written in LLVM's instructions for groups of rows: what a group's rows share is not copied for each.

A group has some arrays (a genome), and each of its rows has some (an observation). On processors lanes are rows of one
group, so that all lanes go the same way through the group's data; on a GPU a thread is a row.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from evoclaims.kernels.emit import gpu_kernel
from evoclaims.kernels.emit.gpu_instructions import GpuInstructions
from evoclaims.kernels.emit.host_kernel import WIDE, handler
from evoclaims.kernels.emit.llvm_ir import Instructions

BYTES: Final = 4
"""Of a number: float32 or int32."""
LANES: Final = 4
"""Vectors of rows computed together, so that operations that wait for each other are not all there is to do."""
ALL: Final = 2**30
"""Rows that are given at a time to a kernel that goes through a group's rows itself."""


@dataclass(frozen=True)
class Sizes:
    """Numbers in an array of a group, of a row, and in a result of a row."""

    groups: tuple[int, ...]
    rows: tuple[int, ...]
    results: tuple[int, ...]


class Rows:
    """The rows that are computed together, one in each lane.

    Attributes:
        page: the instructions.
        count: how many rows there are, an i32.
    """

    def __init__(self, page: Instructions, count: str) -> None:
        """Start; lanes from `count`, an i32, on compute the last row, and store nothing."""
        self.page, self.count = page, count
        if page.lanes > 1:
            integers, numbers = page.vector("i32"), page.numbers_of_lanes()
            self._inside = page.put(f"icmp slt {integers} {numbers}, {page.in_all_lanes('i32', count)}")
            last = page.in_all_lanes("i32", page.put(f"sub i32 {count}, 1"))
            self._lane = page.call(page.mangled("smin", "i32"), integers, [(integers, numbers), (integers, last)])

    def load(self, address: str, size: int, at: int) -> str:
        """Return number `at` of each row of an array of rows of `size` floats."""
        page, where = self.page, self._addresses(address, size, at)
        if page.lanes == 1:
            return page.put(f"load float, ptr {where}, align {BYTES}")
        floats = page.vector("float")
        everywhere = (page.vector("i1"), page.splat("i1", "true"))
        operands = [(page.vector("ptr"), where), ("i32", str(BYTES)), everywhere, (floats, "poison")]
        return page.call(page.mangled("masked.gather", "f32", "p0"), floats, operands)

    def store(self, address: str, size: int, at: int, value: str) -> None:
        """Write number `at` of each row."""
        page, where = self.page, self._addresses(address, size, at)
        if page.lanes == 1:
            page.write(f"store float {value}, ptr {where}, align {BYTES}")
            return
        inside = (page.vector("i1"), self._inside)
        operands = [(page.vector("float"), value), (page.vector("ptr"), where), ("i32", str(BYTES)), inside]
        page.call(page.mangled("masked.scatter", "f32", "p0"), "void", operands)

    def _addresses(self, address: str, size: int, at: int) -> str:
        """Return a register with the address of number `at` of each row."""
        page = self.page
        base = page.put(f"getelementptr float, ptr {address}, i32 {at}")
        if page.lanes == 1:
            return base
        integers = page.vector("i32")
        offsets = page.put(f"mul {integers} {self._lane}, {page.splat('i32', str(size))}")
        return page.put(f"getelementptr float, ptr {base}, {integers} {offsets}")


Writer = Callable[[Rows, Sequence[str], Sequence[str], Sequence[str]], None]
"""Writes what is computed for rows of one group; gets the addresses of the group's arrays, and of the first row's
arrays and results."""


def lanes_for(rows: int, widest: int) -> int:
    """Return how many rows of a group to compute at a time: a power of 2."""
    return min(1 << (rows - 1).bit_length(), LANES * widest)


def host_text(write: Writer, sizes: Sizes, lanes: int, together: int) -> str:
    """Return the text of a kernel for processors.

    Its arguments are an array of int32, [groups, rows of each, and of each array of rows whether (1) or not (0) groups
    have their own], the arrays of groups, and those of rows.

    Args:
        write: what is computed.
        sizes: of the arrays.
        lanes: in a vector.
        together: rows that `write` is given at a time: as many as lanes, unless it goes through them itself.
    """
    page = Instructions(lanes)
    page.label("entry")
    groups, rows, results = _named(sizes)
    write(Rows(page, "%count"), groups, rows, results)
    page.write("ret void")
    body = "\n".join(page.lines)
    given = [f"ptr {name}" for name in (*groups, *rows, *results)]
    block = f"define internal void @block({', '.join([*given, 'i32 %count'])}) {WIDE} {{\n{body}\n}}\n"
    called = handler(2 + len(rows), len(groups) + len(rows), len(results))
    return "\n".join(page.declared) + "\n" + block + _loops(sizes, together) + called


def gpu_text(write: Writer, sizes: Sizes, groups: int, rows: int, own: Sequence[bool]) -> str:
    """Return the text of a kernel for NVIDIA's GPUs, a thread per row of a group; see `host_text`.

    Its parameters are the addresses of the arrays of groups, those of rows, and the results.
    """
    page = GpuInstructions()
    of_groups, of_rows, of_results = _named(sizes)
    thread = gpu_kernel.begin(page, groups * rows)
    group, row = page.put(f"udiv i32 {thread}, {rows}"), page.put(f"urem i32 {thread}, {rows}")
    for name, size in zip(of_groups, sizes.groups, strict=True):
        _moved(page, name, size, group)
    for name, size, is_own in zip(of_rows, sizes.rows, own, strict=True):
        _moved(page, name, size, thread if is_own else row)
    for name, size in zip(of_results, sizes.results, strict=True):
        _moved(page, name, size, thread)
    write(Rows(page, "1"), of_groups, of_rows, of_results)
    return gpu_kernel.finished(page, [f"{name}.all" for name in (*of_groups, *of_rows, *of_results)])


def _named(sizes: Sizes) -> tuple[list[str], list[str], list[str]]:
    """Return the names of the addresses of arrays of groups, of rows, and of results."""
    names = (("g", sizes.groups), ("r", sizes.rows), ("z", sizes.results))
    groups, rows, results = ([f"%{letter}{place}" for place in range(len(arrays))] for letter, arrays in names)
    return groups, rows, results


def _moved(page: Instructions, name: str, size: int, row: str) -> None:
    """Name the address of a row of a GPU's array."""
    begin = page.put(f"mul i64 {page.put(f'zext i32 {row} to i64')}, {size}")
    place = page.put(f"getelementptr float, ptr addrspace(1) {name}.all, i64 {begin}")
    page.write(f"{name} = addrspacecast ptr addrspace(1) {place} to ptr")


def _loops(sizes: Sizes, together: int) -> str:
    """Return the text of the loops over groups and their rows, which call `block`."""
    groups, rows, results = _named(sizes)
    counts = ["i64 %groups", "i64 %rows", *(f"i64 {name}.own" for name in rows)]
    addresses = [f"ptr {name}.all" for name in (*groups, *rows, *results)]
    given = [f"ptr {name}" for name in (*groups, *rows, *results)]
    lines = [
        f"define internal void @work({', '.join([*counts, *addresses])}) nounwind {{",
        "entry:",
        "br label %each",
        "each:",
        "%group = phi i64 [ 0, %entry ], [ %group.next, %after ]",
        "%before = mul i64 %group, %rows",
        "br label %again",
        "again:",
        "%row = phi i64 [ 0, %each ], [ %row.next, %again ]",
        "%place = add i64 %before, %row",
        "%left = sub i64 %rows, %row",
        f"%few = icmp ult i64 %left, {together}",
        f"%some = select i1 %few, i64 %left, i64 {together}",
        "%count = trunc i64 %some to i32",
    ]
    for name, size in zip(groups, sizes.groups, strict=True):
        lines += _address(name, "%group", size)
    for name, size in zip(rows, sizes.rows, strict=True):
        lines += [f"{name}.skipped = mul i64 %before, {name}.own", f"{name}.row = add i64 {name}.skipped, %row"]
        lines += _address(name, f"{name}.row", size)
    for name, size in zip(results, sizes.results, strict=True):
        lines += _address(name, "%place", size)
    lines += [
        f"call void @block({', '.join([*given, 'i32 %count'])})",
        f"%row.next = add i64 %row, {together}",
        "%more.rows = icmp ult i64 %row.next, %rows",
        "br i1 %more.rows, label %again, label %after",
        "after:",
        "%group.next = add i64 %group, 1",
        "%more.groups = icmp ult i64 %group.next, %groups",
        "br i1 %more.groups, label %each, label %done",
        "done:",
        "ret void",
        "}",
    ]
    return "\n".join(lines) + "\n"


def _address(name: str, row: str, size: int) -> list[str]:
    return [f"{name}.begin = mul i64 {row}, {size}", f"{name} = getelementptr float, ptr {name}.all, i64 {name}.begin"]
