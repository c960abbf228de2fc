"""Which warp computes which group of operations: few numbers go from warp to warp, and none waits for long."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

STRETCHES: Final = 4
"""Stretches of a kernel, from its inputs to its results, in each of which every warp gets about as much to do."""
SLACK: Final = 1.3
"""How much more than its share of a stretch a warp may get."""
PUBLISHING: Final = 2.0
"""What writing a number for other warps costs, in readings."""
SWEEPS: Final = 8
"""Most passes through the groups in which they are moved; about three suffice."""


@dataclass(frozen=True)
class Group:
    """Operations that one warp computes.

    Attributes:
        instructions: how many.
        reads: the groups that make the numbers read, by the number's id; these come earlier in the list of groups.
        outside: the warps that have made other numbers read, before, by the number's id.
    """

    instructions: int
    reads: Mapping[int, int]
    outside: Mapping[int, int] = field(default_factory=dict)


def assign(groups: Sequence[Group], warps: int) -> list[int]:
    """Return the warp of each group.

    Each is placed with what it reads, as far as its stretch allows. Then groups are moved, one after the other, as
    long as fewer numbers are read from other warps: local search, as in Kernighan and Lin's partitioning of graphs.
    """
    if not groups:
        return []
    stretch = _stretches(groups)
    share = sum(group.instructions for group in groups) / STRETCHES / warps
    load = [[0] * warps for _ in range(STRETCHES)]
    warp_of: list[int] = []
    for at, group in enumerate(groups):
        near, busy = Counter(home for _, home in _sources(group, warp_of)), load[stretch[at]]
        chosen = max(range(warps), key=lambda w: 2 * near[w] - 3 * busy[w] / share)
        warp_of.append(chosen)
        busy[chosen] += group.instructions
    readers: dict[int, list[int]] = {}  # of each number, how many groups of each warp
    made: list[list[int]] = [[] for _ in groups]
    for at, group in enumerate(groups):
        for number, maker in group.reads.items():
            if number not in readers:
                made[maker].append(number)
        for number, _ in _sources(group, warp_of):
            readers.setdefault(number, [0] * warps)[warp_of[at]] += 1

    def readings(at: int, warp: int) -> float:
        """Return what a group costs if it is the warp's."""
        here = warp_of[at]
        cost = 0.0
        for number, home in _sources(groups[at], warp_of):
            cost += home != warp and readers[number][warp] == (warp == here)
        for number in made[at]:
            others = sum(count > 0 for w, count in enumerate(readers[number]) if w != warp)
            cost += others + PUBLISHING * (others > 0)
        return cost

    for sweep in range(SWEEPS):
        moved = 0
        for at in range(len(groups)) if sweep % 2 == 0 else reversed(range(len(groups))):
            here, busy, size = warp_of[at], load[stretch[at]], groups[at].instructions
            open_to = [w for w in range(warps) if w == here or busy[w] + size <= SLACK * share]
            best = min(open_to, key=lambda w: (readings(at, w), w != here))
            if best == here:
                continue
            warp_of[at] = best
            busy[here] -= size
            busy[best] += size
            for number, _ in _sources(groups[at], warp_of):
                readers[number][here] -= 1
                readers[number][best] += 1
            moved += 1
        if not moved:
            break
    return warp_of


def _sources(group: Group, warp_of: Sequence[int]) -> list[tuple[int, int]]:
    """Return the numbers that a group reads from others, each with the warp that makes it."""
    return [*((number, warp_of[maker]) for number, maker in group.reads.items()), *group.outside.items()]


def _stretches(groups: Sequence[Group]) -> list[int]:
    """Return the stretch of each group: by how long the chains before it are, and those after it."""
    before = [group.instructions for group in groups]
    users: dict[int, set[int]] = defaultdict(set)
    for at, group in enumerate(groups):
        before[at] += max((before[maker] for maker in group.reads.values()), default=0)
        for maker in group.reads.values():
            users[maker].add(at)
    after = [group.instructions for group in groups]
    for at in reversed(range(len(groups))):
        after[at] += max((after[user] for user in users[at]), default=0)
    total, passed = sum(group.instructions for group in groups), 0
    stretch = [0] * len(groups)
    for at in sorted(range(len(groups)), key=lambda at: (before[at] - after[at], at)):
        stretch[at] = min(STRETCHES - 1, STRETCHES * passed // total)
        passed += groups[at].instructions
    return stretch
