"""How the blocks of a GPU's kernel are made up: how many warps share the work for 32 elements, and how many such teams.

A processor of a GPU executes a large kernel no faster than it fetches instructions. Warps with different parts of the
code fetch side by side; warps with the same code that barriers keep in step fetch it once. A block has as many teams as
are needed for all elements to be computed at once, up to three: beyond, keeping in step gains nothing (obstacles with
32,768 robots). The more warps share the work, the less each waits, and the fewer numbers each keeps; registers and
shared memory set the limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import jax

from evoclaims.kernels.emit.gpu_kernel import BLOCK, SMALL
from evoclaims.kernels.emit.shared_slots import Slots, slots
from evoclaims.kernels.emit.warp_schedule import Schedule, schedule
from evoclaims.kernels.trace.expressions import everything
from evoclaims.kernels.trace.interpreter import Numbers

WARPS: Final = {1: 8, 2: 8, 3: 4}
"""Most warps of a team, by the teams of a block: more have too few registers each."""
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
    if len(everything(numbers)) <= SMALL:
        return None
    processors, memory = (_of_device(name, usual) for name, usual in (("core_count", 132), (MEMORY, 99 * 1024)))
    teams = -(-elements // (BLOCK * processors))
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


def _of_device(name: str, usual: int) -> int:
    """Return a property of the GPU; a program may be lowered without a GPU."""
    value: Any = getattr(jax.devices()[0], name, None)
    return int(value) if value else usual
