"""Arrays of int32 in a kernel's memory, and of float32 as bits, read and written at places known when it runs."""

from __future__ import annotations

from evoclaims.kernels.emit.llvm_ir import Instructions


def at(page: Instructions, array: str, place: str) -> str:
    """Return the address of a number of an array."""
    return page.put(f"getelementptr i32, ptr {array}, i32 {place}")


def load(page: Instructions, array: str, place: str = "0") -> str:
    """Return a number of an array."""
    return page.put(f"load i32, ptr {at(page, array, place)}, align 4")


def store(page: Instructions, value: str, array: str, place: str) -> None:
    """Change a number of an array."""
    page.write(f"store i32 {value}, ptr {at(page, array, place)}, align 4")


def fill(page: Instructions, array: str, byte: int, count: int) -> None:
    """Set every byte of the first `count` numbers of an array; a GPU's thread sets one after the other."""
    operands = [("ptr", array), ("i8", str(byte)), ("i64", str(4 * count)), ("i1", "false")]
    page.call("llvm.memset.p0.i64", "void", operands)
