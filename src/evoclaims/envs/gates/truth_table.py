"""Truth tables with levels: the rows of a level are a prefix of the whole table's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evoclaims.envs.base import MisfitError

Bits = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class TruthTable:
    """A circuit's target behaviour.

    Attributes:
        inputs: bits 0/1, shape [rows, inputs].
        targets: target bits 0/1, shape [rows, outputs]; meaningless where not active.
        active: which outputs are scored, shape [rows, outputs].
        rows_at_level: how many leading rows each level asks for, ascending, one entry per level.
    """

    inputs: NDArray[np.float32]
    targets: NDArray[np.bool_]
    active: NDArray[np.bool_]
    rows_at_level: tuple[int, ...]

    def __post_init__(self) -> None:
        """Check that the parts fit together; jax would broadcast wrong shapes, and read past the last row.

        Raises:
            MisfitError: when shapes or types are wrong, a row asks nothing, or level rows do not ascend to all rows.
        """
        rows = len(self.inputs)
        wanted: tuple[tuple[str, NDArray[Any], type], ...] = (
            ("inputs", self.inputs, np.float32),
            ("targets", self.targets, np.bool_),
            ("active", self.active, np.bool_),
        )
        for name, part, dtype in wanted:
            if part.ndim != 2 or len(part) != rows or part.dtype != dtype:
                raise MisfitError(
                    f"a truth table's {name} have shape {part.shape} and type {part.dtype}, and it takes [{rows} rows, "
                    f"…] of type {np.dtype(dtype)}"
                )
        if self.active.shape != self.targets.shape:
            raise MisfitError(
                f"a truth table's active outputs have shape {self.active.shape}, and its targets {self.targets.shape}"
            )
        if not self.active.any(axis=1).all():  # its share of wrong answers would be NaN
            raise MisfitError("a truth table has a row that asks nothing: none of its outputs is active")
        levels = self.rows_at_level
        if not levels or levels[0] < 1 or levels[-1] != rows or any(b <= a for a, b in pairwise(levels)):
            raise MisfitError(f"a truth table's levels ask for {levels} rows, which must increase up to all {rows}")

    @property
    def rows(self) -> int:
        """Rows of the last level."""
        return self.rows_at_level[-1]


def bits_of(number: int, width: int) -> Bits:
    """Return `number` as `width` bits, most significant first."""
    return tuple((number >> shift) & 1 for shift in reversed(range(width)))


def number_of(bits: Sequence[int]) -> int:
    """Return the number with these `bits`, most significant first."""
    return sum(bit << shift for shift, bit in enumerate(reversed(bits)))


@dataclass(frozen=True)
class Operation:
    """A logical operation on the last `inputs` data bits; `compute` maps them to the leading output bits."""

    name: str
    inputs: int
    outputs: int
    compute: Callable[[Bits], Bits]
