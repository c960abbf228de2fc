"""Which rows of a table are which trial: one row a trial, or a row for each step of its training curve."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

from evoclaims.core.errors import UserError
from evoclaims.trials.table_file import TableFile


@dataclass(frozen=True)
class TrialRows:
    """The rows of a table that are read, by trial; rows count from 0.

    Attributes:
        table: that has them.
        where: values by column that a row must have.
        seed: the column of seeds, whole numbers.
        step: the column of environment steps, if a trial has several rows; else empty.
    """

    table: TableFile
    where: Mapping[str, str | int | float | bool]
    seed: str
    step: str

    @cached_property
    def chosen(self) -> list[int]:
        """The rows that are read."""
        return self.table.rows_where(self.where)

    def by_seed(self) -> list[tuple[int, list[int]]]:
        """Return the seeds in their order, each with its rows in the order of steps.

        Raises:
            UserError: when a seed is no whole number, or two rows claim to be the same trial, or the same step of one.
        """
        found: dict[int, list[int]] = {}
        for row, seed in zip(self.chosen, self._seeds(), strict=True):
            found.setdefault(seed, []).append(row)
        return [(seed, self._in_order(seed, rows)) for seed, rows in sorted(found.items())]

    def steps(self, rows: Sequence[int]) -> list[float]:
        """Return the steps of some rows.

        Raises:
            UserError: when one has no step, a number from 0 on.
        """
        found = self.table.numbers(self.step, "the steps", rows)
        for row, step in zip(rows, found, strict=True):
            if step is None or not 0 <= step < math.inf:
                raise UserError(
                    f"Row {row + 1} of {self.table.name} has no step, a number from 0 on, in the column {self.step!r}."
                )
        return [step for step in found if step is not None]

    def _seeds(self) -> list[int]:
        """Return the table's seeds in the rows that are read."""
        found = self.table.numbers(self.seed, "the seeds", self.chosen, rounded=True)
        for row, seed in zip(self.chosen, found, strict=True):
            if seed is None or not seed.is_integer():
                has = "no seed" if seed is None else f"the seed {seed!r}"
                raise UserError(
                    f"Row {row + 1} of {self.table.name} has {has} in the column {self.seed!r}: each trial has a "
                    "whole number."
                )
        cells = self.table.column(self.seed, "the seeds")
        return [_whole(cells[row], seed) for row, seed in zip(self.chosen, found, strict=True) if seed is not None]

    def _in_order(self, seed: int, rows: list[int]) -> list[int]:
        """Return the rows of one trial in the order of steps."""
        if not self.step:
            if len(rows) > 1:
                listed = " and ".join(str(row + 1) for row in rows[:2])
                raise UserError(
                    f"{self.table.name} has {len(rows)} rows of seed {seed} (rows {listed}), and a row is "
                    f"a trial. Choose among them by where={{column: value}}, or name the column of "
                    "training steps by step=."
                )
            return rows
        steps = dict(zip(rows, self.steps(rows), strict=True))
        ordered = sorted(rows, key=steps.__getitem__)
        for row, following in pairwise(ordered):
            if steps[row] == steps[following]:
                raise UserError(
                    f"{self.table.name} has two rows of seed {seed} and {self.step} {steps[row]:g} (rows {row + 1} and "
                    f"{following + 1}): if there are several trials of a seed, choose by where={{column: value}}."
                )
        return ordered


def _whole(cell: Any, number: float) -> int:
    """Return the whole number in a cell that `number` is nearest to: a float has not the digits of large seeds."""
    try:
        return int(cell)
    except ValueError:  # 1e3, 7.0
        return int(number)
