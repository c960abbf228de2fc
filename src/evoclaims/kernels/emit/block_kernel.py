"""A kernel for NVIDIA's GPUs whose work for 32 elements is shared among the warps of a block (`warp_schedule`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import jax

from evoclaims.kernels.emit.gpu_instructions import GpuInstructions
from evoclaims.kernels.emit.gpu_kernel import BLOCK, SMALL, Element, finished, parameters
from evoclaims.kernels.emit.llvm_ir import TYPES, ArrayRow, Instructions
from evoclaims.kernels.emit.shared_slots import Slots, slots
from evoclaims.kernels.emit.warp_schedule import Phase, Schedule, Segment, schedule
from evoclaims.kernels.trace.expressions import (
    Carried,
    Choice,
    Input,
    Loop,
    LoopResult,
    Number,
    ScalarOperation,
    everything,
    is_known,
    operands_of,
)
from evoclaims.kernels.trace.interpreter import Numbers

WARPS: Final = {1: 8, 2: 4, 3: 4}
"""Most warps of a team, by the teams of a block: more have too few registers each."""
IN_TURNS: Final = 22_000
"""From so many operations on, blocks of two teams take turns where a GPU has no room for all elements at a time: an
ant's step is faster so, a half-cheetah's is not."""
MEMORY: Final = "shared_memory_per_block_optin"
"""jax's name for the bytes of shared memory that a block may have."""


@dataclass(frozen=True)
class BlockShape:
    """What a block is made up of.

    Attributes:
        plan: which warp of a team computes what.
        slots: the shared memory of a team.
        teams: of a block.
    """

    plan: Schedule
    slots: Slots
    teams: int

    @property
    def warps(self) -> int:
        """Warps of a team."""
        return self.plan.warps

    @property
    def shared_bytes(self) -> int:
        """Shared memory of a block: a word of each lane for each slot."""
        return self.teams * self.slots.count * BLOCK * 4


def chosen(results: Sequence[Numbers], elements: int) -> BlockShape | None:
    """Return the shape of a kernel's blocks; None if each warp shall compute everything for elements of its own.

    Args:
        results: what is computed for an element.
        elements: of the batch.
    """
    numbers = [number for result in results for number in result.flat]
    operations = len(everything(numbers))
    if operations <= SMALL:
        return None
    processors, memory = processors_and_memory()
    teams = -(-elements // (BLOCK * processors))
    if teams not in WARPS and operations >= IN_TURNS:
        teams = 2
    warps = WARPS.get(teams, 1)
    while warps > 1:
        plan = schedule(numbers, warps)
        if plan is None:
            return None
        shape = BlockShape(plan, slots(plan, numbers), teams)
        if shape.shared_bytes <= memory:
            return shape
        warps //= 2  # fewer leave fewer numbers for each other
    return None


def processors_and_memory() -> tuple[int, int]:
    """Return the GPU's processors, and the bytes of shared memory that a block may have; usual ones without a GPU."""
    device = jax.devices()[0]
    return getattr(device, "core_count", None) or 132, getattr(device, MEMORY, None) or 99 * 1024


SHARED = "@numbers = external addrspace(3) global [0 x i32], align 16\n"
"""The block's shared memory; its size is given at the launch. A slot is a word of each lane."""


def text(
    shape: BlockShape, results: Sequence[Numbers], arrays: Mapping[int, ArrayRow], shared: Mapping[int, int], rows: int
) -> str:
    """Return LLVM's text of a kernel, as `gpu_kernel.text` does.

    Lanes beyond the last element compute the last one, and store nothing: barriers wait for every warp.

    Args:
        shape: of a block.
        results: what is computed for an element, none of them empty.
        arrays: the rows of the arrays read, in order.
        shared: how many consecutive elements share a row of each.
        rows: elements of the batch.
    """
    plan, places, teams = shape.plan, shape.slots, shape.teams
    page = GpuInstructions()
    page.label("entry")
    sources = ("ctaid.x", "tid.x", "tid.y", "tid.z")
    block, lane, own, in_block = (page.call(f"llvm.nvvm.read.ptx.sreg.{name}", "i32", []) for name in sources)
    team = page.put(f"add i32 {page.put(f'mul i32 {block}, {teams}')}, {in_block}")
    element = page.put(f"add i32 {page.put(f'mul i32 {team}, {BLOCK}')}, {lane}")
    inside = page.put(f"icmp ult i32 {element}, {rows}")
    row = page.call("llvm.umin.i32", "i32", [("i32", element), ("i32", str(rows - 1))])
    first_lane = [("i32", "-1"), ("i32", own), ("i32", "0"), ("i32", "31")]
    warp = page.call("llvm.nvvm.shfl.sync.idx.i32", "i32", first_lane)  # so the assembler knows that lanes go together
    first = page.put(f"add i32 {page.put(f'mul i32 {in_block}, {places.count * BLOCK}')}, {lane}")
    words = page.put(f"getelementptr i32, ptr addrspace(3) @numbers, i32 {first}")
    others = " ".join(f"i32 {w}, label %warp{w}" for w in range(1, plan.warps))
    page.write(f"switch i32 {warp}, label %warp0 [ {others} ]")
    for number in range(plan.warps):
        page.label(f"warp{number}")
        element_of = Element(page, row, arrays, shared)
        _Warp(number, plan, places, page, words, element_of).write(results, inside)
    return finished(page, parameters(arrays, len(results)), plan.warps, teams) + SHARED


class _Warp:
    """What one warp does."""

    def __init__(
        self, number: int, plan: Schedule, places: Slots, page: Instructions, words: str, element: Element
    ) -> None:
        """Begin; `words` is the address of the lane's word of the first slot."""
        self._number = number
        self._plan = plan
        self._slots = places
        self._page = page
        self._words = words
        self._element = element
        self._own: dict[int, str] = {}  # registers of what this warp has computed
        self._at_hand: dict[int, str] = {}  # and of what it has read since the last barrier

    def write(self, results: Sequence[Numbers], inside: str) -> None:
        """Write all of it; `inside` says whether the lane has an element of its own."""
        segments = self._plan.segments
        for at, segment in enumerate(segments):
            if segment.loop:
                self._repeat(segment)
                continue
            self._compute(segment.phases)
            if at + 1 < len(segments):
                following = segments[at + 1].loop
                assert following
                self._leave(following, self._values(following.start))
                self._barrier()
        self._store(results, inside)

    def _compute(self, phases: Sequence[Phase]) -> None:
        """Write phases, with barriers between them."""
        for at, phase in enumerate(phases):
            if at:
                self._barrier()
            for operation in phase[self._number]:
                registers = {id(n): self._register(n) for n in operands_of(operation)}
                self._page.compute([operation], registers, self._element.load)
                self._own[id(operation)] = registers[id(operation)]
                if id(operation) in self._slots.of:
                    self._put(operation, registers[id(operation)])

    def _repeat(self, segment: Segment) -> None:
        """Write a loop; its carry stays in slots."""
        page, around = self._page, segment.loop
        assert around

        def body(_: Sequence[str]) -> list[str]:
            self._compute(segment.phases)
            if around.choice:
                self._choose(around, around.choice, segment.ways)
            else:
                self._pass_on(around, around.results)
            self._barrier()
            return []

        page.repeat(f"{page.block}.{{}}", around.rounds, [], [], body)

    def _choose(self, around: Loop, choice: Choice, ways: Sequence[Sequence[Phase]]) -> None:
        """Write both ways to the carry of a loop; all warps of a block take the same one."""
        page = self._page
        is_mine = self._plan.responsible(choice.condition, 0) == self._number
        own = page.put(f"zext i1 {self._register(choice.condition)} to i32") if is_mine else "0"
        anywhere = page.call("llvm.nvvm.barrier0.or", "i32", [("i32", own)])
        whole, short, end = (f"{page.block}.{name}" for name in ("whole", "short", "end"))
        page.write(f"br i1 {page.put(f'icmp ne i32 {anywhere}, 0')}, label %{whole}, label %{short}")
        for name, phases, results in zip((whole, short), ways, (choice.whole, choice.short), strict=True):
            page.label(name)
            self._forget()
            self._compute(phases)
            self._pass_on(around, results)
            page.write(f"br label %{end}")
        page.label(end)

    def _pass_on(self, around: Loop, results: Sequence[Number]) -> None:
        """Leave the results of a round as the loop's carry."""
        following = self._values(results)
        self._barrier()
        self._leave(around, following)

    def _leave(self, around: Loop, values: Sequence[str]) -> None:
        """Leave a loop's carry in its slots, as far as this warp is responsible for it."""
        for carried, value in zip(around.carried, values, strict=True):
            if value:
                self._put(carried, value)

    def _store(self, results: Sequence[Numbers], inside: str) -> None:
        """Write the results that this warp is responsible for."""
        places = [(z, at, result.size) for z, result in enumerate(results) for at in range(result.size)]
        numbers = [number for result in results for number in result.flat]
        values = self._values(numbers)
        self._page.write(f"br i1 {inside}, label %{self._page.block}.store, label %done")
        self._page.label(f"{self._page.block}.store")
        self._element.forget()
        for number, value, place in zip(numbers, values, places, strict=True):
            if value:
                self._element.store(value, number.dtype.kind, *place)
        self._page.write("br label %done")

    def _values(self, numbers: Sequence[Number]) -> list[str]:
        """Return numbers, with "" for those that another warp is responsible for."""

        def value(number: Number) -> str:
            return self._page.operand(number, {} if is_known(number) else {id(number): self._register(number)})

        mine = [self._plan.responsible(number, place) == self._number for place, number in enumerate(numbers)]
        return [value(number) if is_mine else "" for number, is_mine in zip(numbers, mine, strict=True)]

    def _register(self, number: Number) -> str:
        """Return the register with a number; read it from the arrays, or from its slot, if need be."""
        if id(number) in self._own:
            return self._own[id(number)]
        kept = number.loop.carried[number.place] if isinstance(number, LoopResult) else number
        if id(kept) not in self._at_hand:
            read = self._element.load(kept) if isinstance(kept, Input) else self._get(kept)
            self._at_hand[id(kept)] = read
        return self._at_hand[id(kept)]

    def _get(self, number: ScalarOperation | Carried) -> str:
        """Return the register with a number read from its slot."""
        type_ = TYPES[number.dtype.kind]
        stored = "i32" if type_ == "i1" else type_
        value = self._page.put(f"load {stored}, ptr addrspace(3) {self._slot(number)}, align 4")
        return self._page.put(f"icmp ne i32 {value}, 0") if type_ == "i1" else value

    def _put(self, number: ScalarOperation | Carried, value: str) -> None:
        """Write a number to a slot."""
        type_ = TYPES[number.dtype.kind]
        if type_ == "i1":
            value, type_ = self._page.put(f"zext i1 {value} to i32"), "i32"
        self._page.write(f"store {type_} {value}, ptr addrspace(3) {self._slot(number)}, align 4")

    def _slot(self, number: ScalarOperation | Carried) -> str:
        """Return the address of the lane's word of a number's slot."""
        first = self._slots.of[id(number)] * BLOCK
        return self._page.put(f"getelementptr i32, ptr addrspace(3) {self._words}, i32 {first}")

    def _barrier(self) -> None:
        """Wait for the other warps."""
        self._page.call("llvm.nvvm.barrier0", "void", [])
        self._forget()

    def _forget(self) -> None:
        """Forget what is read: it may have changed, or not be at hand."""
        self._at_hand.clear()
        self._element.forget()
