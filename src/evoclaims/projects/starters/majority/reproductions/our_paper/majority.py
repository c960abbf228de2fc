"""A task: a truth table, asked row by row."""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import ClassVar

import numpy as np

from evoclaims.envs import Circuit, Sampling, TruthTable


@dataclass(frozen=True)
class Majority(Circuit):
    """Are most of three bits set?"""

    name: ClassVar[str] = "majority"
    revision: ClassVar[int] = 1  # raise it when the task's results change
    packages: ClassVar[tuple[str, ...]] = ()
    sampling: Sampling = "exhaustive"

    @cached_property
    def table(self):
        """The inputs, the outputs that are right, which of them count, and how many rows each level has."""
        inputs = np.array(list(product((0, 1), repeat=3)))
        targets = inputs.sum(axis=1, keepdims=True) >= 2
        return TruthTable(inputs.astype(np.float32), targets, np.ones_like(targets), rows_at_level=(len(inputs),))
