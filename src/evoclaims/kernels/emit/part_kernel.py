"""A kernel for NVIDIA's GPUs in which each part of an element (`parts`) has a thread, next to the others'."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any, Final

from evoclaims.kernels.emit.gpu_instructions import GpuInstructions
from evoclaims.kernels.emit.gpu_kernel import BLOCK, Element, finished, parameters
from evoclaims.kernels.emit.llvm_ir import TYPES, ArrayRow, literal
from evoclaims.kernels.emit.parts import Parts, Product, Term, Total, term
from evoclaims.kernels.trace.expressions import (
    Expression,
    Input,
    Loop,
    Number,
    ScalarOperation,
    is_known,
    operands_of,
)
from evoclaims.kernels.trace.interpreter import Numbers

EVERYONE: Final = ("i32", "-1")
"""All threads of a warp take part in what they tell each other."""
Unit = tuple[str, int]
"""What is computed at once: ("pack", its number) or ("shared", a number's id)."""
Layout = list[tuple[Unit, list[int]]]
"""What a loop carries, and the places of each unit in the carry, by part."""


def text(
    parts: Parts, results: Sequence[Numbers], arrays: Mapping[int, ArrayRow], shared: Mapping[int, int], rows: int
) -> str:
    """Return LLVM's text of a kernel, as `gpu_kernel.text` does.

    Threads beyond the last element compute the last one, and store nothing: all threads of a warp ask each other.

    Args:
        parts: what is computed for a part.
        results: what is computed for an element, none of them empty.
        arrays: the rows of the arrays read, in order.
        shared: how many consecutive elements share a row of each.
        rows: elements of the batch.
    """
    if BLOCK % parts.count:
        raise ValueError(f"An element has {parts.count} parts, which do not divide a warp of {BLOCK} threads.")
    page = GpuInstructions()
    page.label("entry")
    block, lane = (page.call(f"llvm.nvvm.read.ptx.sreg.{name}.x", "i32", []) for name in ("ctaid", "tid"))
    thread = page.put(f"add i32 {page.put(f'mul i32 {block}, {BLOCK}')}, {lane}")
    element = page.put(f"udiv i32 {thread}, {parts.count}")
    inside = page.put(f"icmp ult i32 {element}, {rows}")
    row = page.call("llvm.umin.i32", "i32", [("i32", element), ("i32", str(rows - 1))])
    part = page.put(f"urem i32 {lane}, {parts.count}")
    writer = _Writer(parts, page, part, Element(page, row, arrays, shared))
    for section in parts.work:
        if isinstance(section, Loop):
            writer.repeat(section)
    writer.store(results, inside)
    return finished(page, parameters(arrays, len(results))) + writer.constants()


class _Writer:
    """Writes a kernel."""

    def __init__(self, parts: Parts, page: GpuInstructions, part: str, element: Element) -> None:
        self._parts = parts
        self._page = page
        self._part = part
        self._element = element
        self._registers: dict[Any, str] = {}
        self._constants: dict[tuple[int, ...], int] = {}
        self._loops = 0

    # What is computed

    def _unit(self, number: Expression) -> Unit:
        pack = self._parts.pack_of.get(id(number))
        return ("shared", id(number)) if pack is None else ("pack", pack)

    def need(self, numbers: Sequence[Number]) -> None:
        """Compute numbers, and first what they are made of."""
        path = [(self._unit(n), [n], False) for n in (term(n)[0] for n in reversed(numbers)) if not is_known(n)]
        while path:
            unit, members, ready = path.pop()
            if unit in self._registers:
                continue
            if unit[0] == "pack":
                members = self._parts.packs[unit[1]]
            if ready:
                self._registers[unit] = self._compute(members, unit[0] == "pack")
                continue
            path.append((unit, members, True))
            total = self._parts.totals.get(id(members[0]))
            read = [o for m in members for o in operands_of(m)] if total is None else total.read()
            for operand in {id(o): o for o in read}.values():
                base = term(operand)[0]
                if not is_known(base) and self._unit(base) not in self._registers:
                    path.append((self._unit(base), [base], False))

    def _compute(self, members: Sequence[Expression], is_pack: bool) -> str:
        """Write an operation of a pack, or a shared one."""
        first = members[0]
        if isinstance(first, Input):
            if not is_pack:
                return self._element.load(first)
            places = [struct.pack("<i", member.place) for member in members if isinstance(member, Input)]
            return self._element.load(first, self._constant(places, "i32"))
        total = self._parts.totals.get(id(first))
        if total is not None:
            return self._sum(total)
        operations = [member for member in members if isinstance(member, ScalarOperation)]
        name, kind, made = operations[0].name, operations[0].operands[-1].dtype.kind, first.dtype.kind
        if not is_pack:
            return self._page.operate(name, kind, made, [self._value([term(o)]) for o in operations[0].operands])
        arranged = [self._parts.arranged(operation) for operation in operations]
        operands = [self._value(operand) for operand in zip(*(operands for _, operands in arranged), strict=True)]
        return self._page.operate(arranged[0][0], kind, made, operands)

    def _sum(self, total: Total) -> str:
        """Write a sum over parts: what each has, these sums by neighbours, then all other terms."""
        page = self._page
        own = self._added("", total.alike)
        distance = 1
        while distance < self._parts.count:
            own = page.put(f"fadd float {own}, {self._shuffled(own, 'f', distance, 'bfly')}")
            distance *= 2
        return self._added(own, [[product] for product in total.others])

    def _added(self, value: str, products: Sequence[Sequence[Product]]) -> str:
        """Write the sum of a value, if there is one, and of products, for every part or for all."""
        for every in products:
            factors = [self._value(factor) for factor in zip(*every, strict=True)]
            if len(factors) == 1:
                value = self._page.put(f"fadd float {value}, {factors[0]}") if value else factors[0]
            elif value:
                value = self._page.operate("fma", "f", "f", [value, *factors])
            else:
                value = self._page.put(f"fmul float {factors[0]}, {factors[1]}")
        return value

    def _value(self, operand: Sequence[Term]) -> str:
        """Return the register with a number for every part, or with one for all; what it is made of is computed."""
        numbers, signs = [number for number, _ in operand], [sign for _, sign in operand]
        kind = numbers[0].dtype.kind
        if all(map(is_known, numbers)):
            literals = [literal(n) for n in numbers]
            if len(set(literals)) == 1:
                return literals[0]
            form = {"f": "<f", "i": "<i", "b": "<i"}[kind]
            return self._constant([struct.pack(form, n.item()) for n in numbers], TYPES[kind])
        value = self._chosen(numbers, TYPES[kind])
        if all(sign > 0 for sign in signs):
            return value
        if all(sign < 0 for sign in signs):
            return self._page.put(f"fneg float {value}")
        flips = self._constant([struct.pack("<f", sign) for sign in signs], "float")
        return self._page.put(f"fmul float {value}, {flips}")

    def _chosen(self, numbers: Sequence[Number], type_: str) -> str:
        """Return the register with the number of each part."""
        if len(numbers) == 1 or len({id(n) for n in numbers}) == 1:
            return self._everywhere(numbers[0])
        here = [
            self._registers["pack", self._parts.pack_of[id(n)]]
            if self._parts.part_of.get(id(n)) == part
            else self._everywhere(n)
            for part, n in enumerate(numbers)
        ]
        value = here[-1]
        for part in reversed(range(len(here) - 1)):
            if here[part] != value:
                mine = self._page.put(f"icmp eq i32 {self._part}, {part}")
                same = [p for p in range(part) if here[p] == here[part]]
                for other in same:
                    also = self._page.put(f"icmp eq i32 {self._part}, {other}")
                    mine = self._page.put(f"or i1 {mine}, {also}")
                value = self._page.put(f"select i1 {mine}, {type_} {here[part]}, {type_} {value}")
        return value

    def _everywhere(self, number: Number) -> str:
        """Return the register with a number in every part's thread."""
        if is_known(number):
            return literal(number)
        part = self._parts.part_of.get(id(number))
        if part is None:
            return self._registers["shared", id(number)]
        key = ("everywhere", id(number))
        if key not in self._registers:
            self._registers[key] = self._shuffled(self._registers[self._unit(number)], number.dtype.kind, part)
        return self._registers[key]

    def _shuffled(self, value: str, kind: str, part: int, mode: str = "idx") -> str:
        """Return what a part's thread has; or, by `bfly`, one whose number differs by a bit."""
        page, suffix = self._page, "f32" if kind == "f" else "i32"
        type_ = "float" if kind == "f" else "i32"
        if kind == "b":
            value = page.put(f"zext i1 {value} to i32")
        within = ((BLOCK - self._parts.count) << 8) | (BLOCK - 1)
        shuffled = page.call(
            f"llvm.nvvm.shfl.sync.{mode}.{suffix}",
            type_,
            [EVERYONE, (type_, value), ("i32", str(part)), ("i32", str(within))],
        )
        return page.put(f"icmp ne i32 {shuffled}, 0") if kind == "b" else shuffled

    def _constant(self, values: Sequence[bytes], type_: str) -> str:
        """Return the register with a part's constant."""
        words = tuple(struct.unpack("<i", value)[0] for value in values)
        place = self._constants.setdefault(words, len(self._constants)) * self._parts.count
        at = self._page.put(f"add i32 {self._part}, {place}")
        where = self._page.put(f"getelementptr i32, ptr addrspace(4) @constants, i32 {at}")
        word = self._page.put(f"load i32, ptr addrspace(4) {where}, align 4")
        if type_ == "i1":
            return self._page.put(f"icmp ne i32 {word}, 0")
        return word if type_ == "i32" else self._page.put(f"bitcast i32 {word} to float")

    def constants(self) -> str:
        """Return the text of the constants of parts."""
        words = [f"i32 {word}" for words in self._constants for word in words]
        if not words:
            return ""
        return f"@constants = internal addrspace(4) constant [{len(words)} x i32] [{', '.join(words)}], align 4\n"

    # In which order

    def _layout(self, around: Loop) -> Layout:
        """Return the layout of what a loop carries."""
        places = {id(c): at for at, c in enumerate(around.carried)}
        units = {self._unit(c): c for c in around.carried}
        return [
            (unit, [places[id(m)] for m in (self._parts.packs[unit[1]] if unit[0] == "pack" else [one])])
            for unit, one in units.items()
        ]

    def _carry(self, layout: Layout, numbers: Sequence[Number]) -> list[str]:
        """Return the registers with what is carried."""
        self.need(numbers)
        return [self._value([term(numbers[place]) for place in places]) for _, places in layout]

    def repeat(self, around: Loop) -> None:
        """Write a loop."""
        layout = self._layout(around)
        units = [unit for unit, _ in layout]
        types = [TYPES[around.carried[places[0]].dtype.kind] for _, places in layout]
        start = self._carry(layout, around.start)
        self.need(around.taken)
        self._loops += 1
        outside, name = self._registers, f"loop{self._loops}"

        def body(carried: Sequence[str]) -> list[str]:
            self._registers = outside | dict(zip(units, carried, strict=True))
            return self._round(around, layout, types, name)

        results = self._page.repeat(f"{name}.{{}}", around.rounds, types, start, body)
        self._registers = outside | dict(zip(units, results, strict=True))

    def _round(self, around: Loop, layout: Layout, types: Sequence[str], name: str) -> list[str]:
        """Write a round; return what it carries on. All threads of a warp take the same way."""
        choice, page = around.choice, self._page
        if choice is None:
            return self._carry(layout, around.results)
        self.need([choice.condition, *choice.taken])
        condition = self._value([term(choice.condition)])
        anywhere = page.in_any_lane(condition)
        before = self._registers

        def way(numbers: Sequence[Number]) -> list[str]:
            self._registers = dict(before)
            self._element.forget()
            return self._carry(layout, numbers)

        results = page.choose(f"{name}.{{}}", choice, anywhere, types, way)
        self._registers = before
        self._element.forget()
        return results

    def store(self, results: Sequence[Numbers], inside: str) -> None:
        """Write the results: each part's thread its own, and its share of the others."""
        page, parts = self._page, self._parts
        numbers = [number for result in results for number in result.flat]
        self.need(numbers)
        places = [(z, at, result.size) for z, result in enumerate(results) for at in range(result.size)]
        page.write(f"br i1 {inside}, label %store, label %done")
        page.label("store")
        others = " ".join(f"i32 {p}, label %store{p}" for p in range(1, parts.count))
        page.write(f"switch i32 {self._part}, label %store0 [ {others} ]")
        for part in range(parts.count):
            page.label(f"store{part}")
            self._element.forget()
            for turn, (number, place) in enumerate(zip(numbers, places, strict=True)):
                base, sign = term(number)
                owner = parts.part_of.get(id(base), turn % parts.count)
                if owner != part:
                    continue
                value = literal(base) if is_known(base) else self._registers[self._unit(base)]
                if sign < 0:
                    value = page.put(f"fneg float {value}")
                self._element.store(value, number.dtype.kind, *place)
            if part + 1 < parts.count:
                page.write("br label %done")
