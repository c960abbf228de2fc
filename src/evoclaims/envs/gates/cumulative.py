"""N-parity that keeps asking the rows of earlier levels: a reading of the paper's curriculum, a named variant."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from evoclaims.envs.gates.parity import NParity
from evoclaims.envs.gates.truth_table import TruthTable


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
