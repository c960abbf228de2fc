"""Truth tables with levels: the rows of a level are a prefix of the whole table's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Bits = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class TruthTable:
    """A circuit's wanted behaviour.

    Attributes:
        inputs: bits 0/1, shape [rows, inputs].
        targets: wanted bits 0/1, shape [rows, outputs]; meaningless where not active.
        active: which outputs are scored, shape [rows, outputs].
        rows_at_level: how many leading rows each level asks for, ascending, one entry per level.
    """

    inputs: NDArray[np.float32]
    targets: NDArray[np.bool_]
    active: NDArray[np.bool_]
    rows_at_level: tuple[int, ...]

    @property
    def rows(self) -> int:
        """Rows of the last level."""
        return self.rows_at_level[-1]


def bits_of(number: int, width: int) -> Bits:
    """Return `number` as `width` bits, most significant first."""
    return tuple((number >> shift) & 1 for shift in reversed(range(width)))


def number_of(bits: Sequence[int]) -> int:
    """Return the number that `bits` spell, most significant first."""
    return sum(bit << shift for shift, bit in enumerate(reversed(bits)))


@dataclass(frozen=True)
class Operation:
    """A logical operation on the last `inputs` data bits; `compute` maps them to the leading output bits."""

    name: str
    inputs: int
    outputs: int
    compute: Callable[[Bits], Bits]
