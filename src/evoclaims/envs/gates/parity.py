"""N-parity: the sum modulo 2 of a growing number of bits (§3.1.1 of the paper)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from evoclaims.core.errors import UserError
from evoclaims.envs.gates.circuit import Circuit, Sampling, TruthTable, bits_of


@dataclass(frozen=True)
class NParity(Circuit):
    """Level k (0 … bits − 2) asks for the parity of the last k + 2 bits; the others are 0.

    Attributes:
        bits: N, from 2 to 12.
        sampling: see `Circuit`.
    """

    name: ClassVar[str] = "n_parity"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ()

    bits: int = 6
    sampling: Sampling = "exhaustive"

    def __post_init__(self) -> None:
        """Check the size."""
        if not 2 <= self.bits <= 12:
            raise UserError(f"N-parity has bits={self.bits}. Write a number from 2 to 12.")
        super().__post_init__()

    @cached_property
    def table(self) -> TruthTable:
        """All 2^bits rows in counting order, so that level k is the first 2^(k + 2) of them."""
        rows = np.array([bits_of(number, self.bits) for number in range(2**self.bits)])
        return TruthTable(
            inputs=rows.astype(np.float32),
            targets=(rows.sum(axis=1, keepdims=True) % 2).astype(bool),
            active=np.ones((len(rows), 1), dtype=bool),
            rows_at_level=tuple(2 ** (level + 2) for level in range(self.bits - 1)),
        )


@dataclass(frozen=True)
class CumulativeParity(NParity):
    """Level k asks the tables of levels 0 … k of N-parity, one after the other.

    One of the published environments can do so; no published script does with the curriculum. Rows of early levels are
    asked once for every level so far, so forgetting them costs more than in `NParity`, and success weighs them the same
    way.
    """

    name: ClassVar[str] = "cumulative_parity"
    revision: ClassVar[int] = 1

    @cached_property
    def table(self) -> TruthTable:
        """The levels in order, so that level k is a prefix: the first 4 + 8 + … + 2^(k + 2) rows."""
        plain = NParity(self.bits).table
        rows = np.concatenate([np.arange(count) for count in plain.rows_at_level])
        return TruthTable(
            inputs=plain.inputs[rows],
            targets=plain.targets[rows],
            active=plain.active[rows],
            rows_at_level=tuple(int(end) for end in np.cumsum(plain.rows_at_level)),
        )
