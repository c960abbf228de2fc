"""Which warp of a GPU's block computes which expression of a kernel, and when.

An ant's time step has 40,000 operations in chains of at most 700: more than a thread's registers and a processor's
instruction cache hold, so that a warp alone waits for its instructions. Several warps share the step instead, each with
its own part of the code (as in Bauer et al., "Singe: leveraging warp specialization for high performance on GPUs",
PPoPP 2014). Lane i of each warp works for the team's i-th element. Work goes in phases; what a warp computes is visible
to the others from the next phase on. Within a phase a warp may go on with what it has itself computed.
"""

from __future__ import annotations

import heapq
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from evoclaims.kernels.trace.expressions import (
    Chosen,
    Expression,
    Loop,
    LoopResult,
    Number,
    ScalarOperation,
    in_order,
    is_known,
    operands_of,
)

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


INSTRUCTIONS: Final = {"div": 9, "sqrt": 9}
"""Of an operation; all others take one."""
GROUP: Final = 8
"""Most instructions of operations that are placed together: each but the last has only one use, in the same group."""
BUDGET: Final = 100
"""Instructions of a warp after which a phase ends: with fewer there are more barriers, with more, warps wait longer."""
Phase = tuple[tuple[ScalarOperation, ...], ...]
"""The operations of each warp, in order."""


@dataclass(frozen=True)
class Segment:
    """What comes between loops, or a round of a loop.

    Attributes:
        loop: whose round it is.
        phases: at least one.
        ways: those of the whole and of the short way in which the round goes on, if it has a choice.
    """

    loop: Loop | None
    phases: tuple[Phase, ...]
    ways: tuple[tuple[Phase, ...], ...] = ()


@dataclass(frozen=True)
class Schedule:
    """A kernel shared among warps.

    Attributes:
        warps: how many.
        segments: in order.
        owner: the warp that computes each operation, by the operation's id.
    """

    warps: int
    segments: tuple[Segment, ...]
    owner: Mapping[int, int]

    def responsible(self, number: Number, place: int) -> int:
        """Return the warp that stores a number as the result, or the carry, at a place."""
        return self.owner.get(id(number), place % self.warps)


def schedule(results: Sequence[Number], warps: int) -> Schedule | None:
    """Share a kernel among warps.

    Returns:
        The schedule; None for a kernel with a loop or a choice where only one warp can compute it: a loop inside
        another, a choice outside of loops.
    """
    order = in_order(results)
    loops = list({id(e.loop): e.loop for e in order if isinstance(e, LoopResult)}.values())
    inner = [e for around in loops for part in _round(around) for e in part]
    if any(isinstance(e, LoopResult) for e in inner) or any(isinstance(e, Chosen) for e in order):
        return None
    place = {id(around): at for at, around in enumerate(loops)}
    after: dict[int, int] = {}  # how many loops must have ended before each expression
    stretches: list[list[ScalarOperation]] = [[] for _ in range(len(loops) + 1)]
    for expression in order:
        if isinstance(expression, LoopResult):
            after[id(expression)] = place[id(expression.loop)] + 1
        elif isinstance(expression, ScalarOperation):
            after[id(expression)] = max((after[id(o)] for o in expression.operands if not is_known(o)), default=0)
            stretches[after[id(expression)]].append(expression)
        else:
            after[id(expression)] = 0
    owner: dict[int, int] = {}
    segments = []
    for at, stretch in enumerate(stretches):
        segments.append(Segment(None, _phases(stretch, warps, owner)))
        if at < len(loops):
            parts = [[e for e in part if isinstance(e, ScalarOperation)] for part in _round(loops[at])]
            first, *ways = [_phases(part, warps, owner) for part in parts]
            segments.append(Segment(loops[at], first, tuple(ways)))
    return Schedule(warps, tuple(segments), owner)


def _round(around: Loop) -> list[list[Expression]]:
    """Return what a loop computes in a round, operands first; with a choice in parts: before it, and on either way."""
    inside = set(map(id, around.carried))
    choice = around.choice
    if choice is None:
        return [_added(around.results, inside)]
    before = _added([choice.condition, *choice.taken], inside)
    return [before, *(_added(way, set(inside)) for way in (choice.whole, choice.short))]


def _added(numbers: Sequence[Number], inside: set[int]) -> list[Expression]:
    """Return what these need beyond what is `inside` a round, but in the round; add its ids."""
    added = []
    for expression in in_order(numbers):
        if id(expression) not in inside and any(id(p) in inside for p in operands_of(expression)):
            inside.add(id(expression))
            added.append(expression)
    return added


def _groups(
    operations: Sequence[ScalarOperation], owner: Mapping[int, int]
) -> tuple[list[Group], list[list[ScalarOperation]]]:
    """Put each operation that has one use with that use, as long as groups stay small; operands' groups come first."""
    read = {id(o): list(dict.fromkeys(map(id, operands_of(o)))) for o in operations}
    users: dict[int, list[int]] = defaultdict(list)
    for operation in operations:
        for number in read[id(operation)]:
            users[number].append(id(operation))
    root: dict[int, int] = {}
    size: Counter[int] = Counter()
    # Backwards, since an operation joins the group of its one use, which has to be known before.
    for operation in reversed(operations):
        mine, used = INSTRUCTIONS.get(operation.name, 1), users[id(operation)]
        joins = len(used) == 1 and size[root[used[0]]] + mine <= GROUP
        root[id(operation)] = root[used[0]] if joins else id(operation)
        size[root[id(operation)]] += mine
    members: dict[int, list[ScalarOperation]] = defaultdict(list)
    for operation in operations:
        members[root[id(operation)]].append(operation)
    last = [o for o in operations if root[id(o)] == id(o)]  # of each group
    number_of = {id(o): number for number, o in enumerate(last)}
    groups = []
    for operation in last:
        reads = [r for member in members[id(operation)] for r in read[id(member)]]
        makers = {r: number_of[root[r]] for r in reads if r in root and root[r] != id(operation)}
        outside = {r: owner[r] for r in reads if r not in root and r in owner}
        groups.append(Group(size[id(operation)], makers, outside))
    return groups, [members[id(o)] for o in last]


def _phases(operations: Sequence[ScalarOperation], warps: int, owner: dict[int, int]) -> tuple[Phase, ...]:
    """Share operations among warps, the longest chains first; `owner` gets them."""
    groups, members = _groups(operations, owner)
    warp_of = assign(groups, warps)
    for at, together in enumerate(members):
        owner.update((id(operation), warp_of[at]) for operation in together)
    before = [set(group.reads.values()) for group in groups]
    users: list[list[int]] = [[] for _ in groups]
    for at, makers in enumerate(before):
        for maker in makers:
            users[maker].append(at)
    # The longest remaining chain first: a chain that starts late keeps all warps waiting at the end.
    turn = [0] * len(groups)  # lower ones come first: the instructions from here to the end, negated
    for at in reversed(range(len(groups))):
        turn[at] = min((turn[user] for user in users[at]), default=0) - groups[at].instructions
    missing = [len(makers) for makers in before]
    phase_of: dict[int, int] = {}
    phases: list[Phase] = []
    ready = [at for at in range(len(groups)) if not missing[at]]
    while ready:
        queues: list[list[tuple[int, int]]] = [[] for _ in range(warps)]
        for at in ready:
            heapq.heappush(queues[warp_of[at]], (turn[at], at))
        ready = []
        done: list[list[ScalarOperation]] = [[] for _ in range(warps)]
        for warp, queue in enumerate(queues):
            load = 0
            while queue and load < BUDGET:
                at = heapq.heappop(queue)[1]
                load += groups[at].instructions
                done[warp] += members[at]
                phase_of[at] = len(phases)
                for user in users[at]:
                    missing[user] -= 1
                    if missing[user]:
                        continue
                    # What another warp makes in this phase is visible only behind the barrier at its end.
                    here = {warp_of[maker] for maker in before[user] if phase_of[maker] == len(phases)}
                    if here == {warp} == {warp_of[user]}:
                        heapq.heappush(queue, (turn[user], user))
                    else:
                        ready.append(user)
            ready += [at for _, at in queue]
        phases.append(tuple(map(tuple, done)))
    return tuple(phases) or (((),) * warps,)
