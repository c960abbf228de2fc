"""Where the warps of a block leave numbers for each other: slots of the block's shared memory, each used many times."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

from evoclaims.kernels.expressions import Carried, Input, LoopResult, Number, is_known, operands_of
from evoclaims.kernels.warp_schedule import Phase, Schedule


@dataclass(frozen=True)
class Slots:
    """The slots of a kernel.

    Attributes:
        count: how many there are.
        of: the slot of each number that another warp reads, and of each number that a loop carries, by its id.
    """

    count: int
    of: dict[int, int]


def slots(schedule: Schedule, results: Sequence[Number]) -> Slots:
    """Return the slots of a kernel that computes `results`.

    Two numbers share a slot if the first is read for the last time in an earlier phase than that in which the second is
    written; barriers are between phases.
    """
    uses = _Uses(schedule, results)
    slot_of: dict[int, int] = {}
    taken: list[tuple[int, int]] = []  # by when they are read for the last time: slots
    count = 0
    for number, written in sorted(uses.written.items(), key=lambda use: use[1]):
        if taken and taken[0][0] < written:
            slot = heapq.heappop(taken)[1]
        else:
            slot, count = count, count + 1
        slot_of[number] = slot
        heapq.heappush(taken, (uses.read[number], slot))
    return Slots(count, slot_of)


class _Uses:
    """When numbers in slots are written and read for the last time, by their ids; phases are counted from the first."""

    def __init__(self, schedule: Schedule, results: Sequence[Number]) -> None:
        """Go through a schedule."""
        self.written: dict[int, int] = {}
        self.read: dict[int, int] = {}
        self._schedule = schedule
        self._made: dict[int, int] = {}
        self._begin = self._last = 0  # of the segment
        now = 0
        for at, segment in enumerate(schedule.segments):
            self._begin, self._last = now, now + sum(map(len, (segment.phases, *segment.ways))) - 1
            now = self._compute(segment.phases, now)
            if segment.loop:
                choice = segment.loop.choice
                if choice:
                    self._store([choice.condition], now - 1)
                    for phases, numbers in zip(segment.ways, (choice.whole, choice.short), strict=True):
                        now = self._compute(phases, now)
                        self._store(numbers, now - 1)
                else:
                    self._store(segment.loop.results, now - 1)
                self.read |= {id(c): now for c in segment.loop.carried}  # the next carry, after a barrier of its own
                now += 1
            elif at + 1 < len(schedule.segments):
                following = schedule.segments[at + 1].loop
                assert following
                self._store(following.start, self._last)
                self.written |= {id(c): self._last for c in following.carried}
            else:
                self._store(results, self._last)

    def _compute(self, phases: Sequence[Phase], now: int) -> int:
        """Go through phases, of which the first is `now`; return what comes after them."""
        for phase in phases:
            for warp, operations in enumerate(phase):
                for operation in operations:
                    self._made[id(operation)] = now
                    for number in operands_of(operation):
                        self._note(number, warp, now)
            now += 1
        return now

    def _store(self, numbers: Sequence[Number], now: int) -> None:
        """Note that numbers are read at the end of a phase, each by the warp that stores it."""
        for place, number in enumerate(numbers):
            self._note(number, self._schedule.responsible(number, place), now)

    def _note(self, number: Number, warp: int, now: int) -> None:
        """Note that a warp reads a number."""
        if is_known(number) or isinstance(number, Input):
            return
        if isinstance(number, LoopResult):
            number = number.loop.carried[number.place]
        if not isinstance(number, Carried):
            if self._schedule.owner[id(number)] == warp:
                return
            self.written[id(number)] = self._made[id(number)]
            if self._made[id(number)] < self._begin:  # every round of a loop reads it
                now = self._last
        self.read[id(number)] = max(self.read.get(id(number), 0), now)
