"""Where the warps of a block leave numbers for each other: slots of the block's shared memory, each used many times."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from evoclaims.kernels.emit.warp_schedule import Phase, Schedule
from evoclaims.kernels.trace.expressions import Carried, Input, LoopResult, Number, is_known, operands_of


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
    written; barriers are between phases. Numbers of one way of a choice share slots with those of the other.
    """
    uses = _Uses(schedule, results)
    slot_of: dict[int, int] = {}
    # Only one way of a choice runs in a round, so the short way may write over what the whole way writes.
    short = {number for _, numbers in uses.short for number in numbers}
    count = _place([n for n in uses.written if n not in short], uses, [], slot_of)
    for begin, numbers in uses.short:
        last = dict.fromkeys(range(count), -1)  # when each slot is read for the last time, but for the whole way
        for number, slot in slot_of.items():
            if uses.written[number] < begin:
                last[slot] = max(last[slot], uses.read[number])
        taken = [(time, slot) for slot, time in last.items()]
        heapq.heapify(taken)
        count = _place([n for n in numbers if n in uses.written], uses, taken, slot_of)
    return Slots(count, slot_of)


def _place(numbers: Iterable[int], uses: _Uses, taken: list[tuple[int, int]], slot_of: dict[int, int]) -> int:
    """Give numbers slots; return how many slots there are.

    Args:
        numbers: their ids.
        uses: when they are used.
        taken: a heap of the slots so far, by when they are read for the last time.
        slot_of: gets each number's slot.
    """
    for number in sorted(numbers, key=uses.written.__getitem__):
        # Strictly earlier: within a phase no barrier orders the last read before the write.
        free = taken and taken[0][0] < uses.written[number]
        slot = heapq.heappop(taken)[1] if free else len(taken)
        slot_of[number] = slot
        heapq.heappush(taken, (uses.read[number], slot))
    return len(taken)


class _Uses:
    """When numbers in slots are written and read for the last time, by their ids; phases are counted from the first."""

    def __init__(self, schedule: Schedule, results: Sequence[Number]) -> None:
        """Go through a schedule."""
        self.written: dict[int, int] = {}
        self.read: dict[int, int] = {}
        self.short: list[tuple[int, list[int]]] = []  # when each choice's ways begin, and what its short way makes
        self._schedule = schedule
        self._made: dict[int, int] = {}
        self._begin = self._last = 0  # of the segment
        now = 0
        for at, segment in enumerate(schedule.segments):
            ways = max(map(len, segment.ways), default=0)
            self._begin, self._last = now, now + len(segment.phases) + ways - 1
            now = self._compute(segment.phases, now)
            if segment.loop:
                choice = segment.loop.choice
                if choice:
                    self._store([choice.condition], now - 1)
                    for phases, numbers in zip(segment.ways, (choice.whole, choice.short), strict=True):
                        self._store(numbers, self._compute(phases, now) - 1)
                    short = [id(o) for phase in segment.ways[1] for own in phase for o in own]
                    self.short.append((now, short))
                    now += ways
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
