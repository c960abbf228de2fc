"""Loops, choices and memory in LLVM's text, at bounds and places that are known when the kernel runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from evoclaims.kernels.emit.llvm_ir import Instructions, either

Typed = tuple[str, str]
"""A type and a value of it."""


def repeat(
    page: Instructions, begin: str, end: str, carried: Sequence[Typed], body: Callable[..., Sequence[str]]
) -> list[str]:
    """Write a loop over the int32 from `begin` to below `end`; return what it carries after the last round.

    Args:
        page: where to.
        begin: the first number.
        end: where it stops; there is no round if `begin` is not smaller.
        carried: what the first round gets.
        body: writes a round; gets the loop's number and what is carried, and returns what the next round gets.
    """
    name = page.register().removeprefix("%")
    before = page.block
    page.write(f"br label %{name}.head")
    page.label(f"{name}.head")
    at = len(page.lines)
    number, registers = page.register(), [page.register() for _ in carried]
    more = page.put(f"icmp slt i32 {number}, {end}")
    page.write(f"br i1 {more}, label %{name}.body, label %{name}.done")
    page.label(f"{name}.body")
    following = body(number, *registers)
    next_number = page.put(f"add i32 {number}, 1")
    page.lines[at:at] = [
        either(register, type_, (first, before), (after, page.block))
        for register, (type_, first), after in zip(
            [number, *registers], [("i32", begin), *carried], [next_number, *following], strict=True
        )
    ]
    page.write(f"br label %{name}.head")
    page.label(f"{name}.done")
    return registers


def walk(page: Instructions, start: str, ends: Callable[[str], str], following: Callable[[str], str]) -> str:
    """Write a walk through int32, from `start` on; return the first at which it `ends`, an i1."""
    name = page.register().removeprefix("%")
    before = page.block
    page.write(f"br label %{name}.head")
    page.label(f"{name}.head")
    at = len(page.lines)
    current = page.register()
    page.write(f"br i1 {ends(current)}, label %{name}.done, label %{name}.body")
    page.label(f"{name}.body")
    page.lines[at:at] = [either(current, "i32", (start, before), (following(current), page.block))]
    page.write(f"br label %{name}.head")
    page.label(f"{name}.done")
    return current


def choose(page: Instructions, index: str, type_: str, cases: Sequence[Callable[[], str]]) -> str:
    """Write a choice; return the value of the case that `index`, an int32, says, or else of the last."""
    name = page.register().removeprefix("%")
    last = len(cases) - 1
    targets = " ".join(f"i32 {place}, label %{name}.{place}" for place in range(last))
    page.write(f"switch i32 {index}, label %{name}.{last} [ {targets} ]")
    sources = []
    for place, case in enumerate(cases):
        page.label(f"{name}.{place}")
        sources.append((case(), page.block))
        page.write(f"br label %{name}.done")
    page.label(f"{name}.done")
    value = page.register()
    page.write(either(value, type_, *sources))
    return value


def when(page: Instructions, condition: str, type_: str, yes: Callable[[], str], no: str) -> str:
    """Write what is computed only under a condition, an i1; return its value, or `no`."""
    name = page.register().removeprefix("%")
    before = page.block
    page.write(f"br i1 {condition}, label %{name}.yes, label %{name}.done")
    page.label(f"{name}.yes")
    made = yes()
    after = page.block
    page.write(f"br label %{name}.done")
    page.label(f"{name}.done")
    value = page.register()
    page.write(either(value, type_, (made, after), (no, before)))
    return value


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
