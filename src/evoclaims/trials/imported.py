"""Trials that another program has run: a table of their results stands where a condition would."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from evoclaims.core.errors import UserError
from evoclaims.core.packages import DEPENDS_ON
from evoclaims.core.provenance import version_of
from evoclaims.trials.result import Status, TrialResult, check_shares, check_success, digest
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import Store
from evoclaims.trials.table_file import TableFile, exact, read_table


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
            UserError: when one has no step, a whole number from 0 on: a budget is one, and a curve reaches it or not.
        """
        found = self.table.numbers(self.step, "the steps", rows)
        for row, step in zip(rows, found, strict=True):
            if step is None or step < 0 or not step.is_integer():
                has = "no step" if step is None else f"the step {step!r}"
                raise UserError(
                    f"Row {row + 1} of {self.table.name} has {has} in the column {self.step!r}: write environment "
                    "steps, whole numbers from 0 on."
                )
        return [step for step in found if step is not None]

    def _seeds(self) -> list[int]:
        found = self.table.numbers(self.seed, "the seeds", self.chosen, rounded=True)
        for row, seed in zip(self.chosen, found, strict=True):
            if seed is None or not seed.is_integer():
                has = "no seed" if seed is None else f"the seed {seed!r}"
                raise UserError(
                    f"Row {row + 1} of {self.table.name} has {has} in the column {self.seed!r}: each trial has a "
                    "whole number."
                )
        cells = self.table.column(self.seed, "the seeds")
        return [int(exact(cells[row])) for row in self.chosen]

    def _in_order(self, seed: int, rows: list[int]) -> list[int]:
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


REVISION: Final = 1
"""Raised when the same table gives other trials, so that old records are not taken for new ones."""

STEPS: Final = "environment_steps"
"""What the harness's own trials call the steps of a curve, and their number in a whole trial."""


@dataclass(frozen=True)
class _Unknown:
    """Stands for the method and the task of imported trials, of which nothing is known here."""

    name: str = "imported"
    revision: int = 1
    levels: int = 1
    packages: tuple[str, ...] = ()


_WANTED: Final[Mapping[str, tuple[Any, str]]] = {
    "path": (str | Path, "the path of a table"),
    "seed": (str, "the name of a column"),
    "metric": (str | Sequence | Mapping, "the name of a column, or several"),
    "where": (Mapping, 'values by column, such as {"algo": "sac"}'),
    "step": (str, "the name of a column, or leave it out"),
    "by": (str, "text"),
    "empty_means_diverged": (bool, "True or False"),
}
"""What a field has to be: in words like "no", which is true to Python, nobody would see what counts."""


@dataclass(frozen=True)
class Imported(Condition):
    """Trials that another program has run, read from a table; they are judged as the harness's own are.

    Trial k, which a design asks for as seed k, is the one with the k-th smallest seed of the table (from 0): the table
    and the design alone say which trials are judged.

    Attributes:
        path: of the table (.csv, .tsv, .json, .jsonl or .parquet), relative to the reproduction's folder.
        seed: the column of seeds, whole numbers. One row is one trial, unless `step` is given.
        metric: the column of what was measured in the end, or several, or columns by the names that measures read:
            `{"last_fitness": "return"}` makes `reward` the column "return".
        where: values by column that a row must have, such as `{"algo": "sac", "env": "hopper"}`.
        step: the column of environment steps, if a trial has several rows: its training curve. The last number of a
            metric counts.
        by: who has run the trials, and with what; the records and the report say so.
        empty_means_diverged: an empty cell, or one at the end of a curve, stands for a trial that diverged, as "nan"
            does; else a trial without a number is an error.
        folder: where `path` is; the reproduction sets it.
    """

    path: str | Path
    seed: str
    metric: str | Sequence[str] | Mapping[str, str] = field(hash=False)
    where: Mapping[str, str | int | float | bool] = field(default_factory=dict, hash=False, kw_only=True)
    step: str = field(default="", kw_only=True)
    by: str = field(default="", kw_only=True)
    empty_means_diverged: bool = field(default=False, kw_only=True)
    folder: Path = field(default=Path(), kw_only=True)
    method: Any = field(init=False, repr=False, default=_Unknown())
    task: Any = field(init=False, repr=False, default=_Unknown())
    progression: Any = field(init=False, repr=False, default="whole_budget")
    budget: Any = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        """Reject what no table is read by, a table from which no number is read, and two axes of a curve."""
        for name, (kind, wanted) in _WANTED.items():
            given = getattr(self, name)
            if not isinstance(given, kind):
                raise UserError(f"Imported({str(self.path)!r}) has {name}={given!r}. Write {wanted}.")
        if not all(isinstance(name, str) for columns in self.columns.items() for name in columns):
            raise UserError(
                f"Imported({str(self.path)!r}) has metric={self.metric!r}. Write a column's name, or several, or "
                "columns by metrics' names."
            )
        if not self.columns:
            raise UserError(
                f"Imported({str(self.path)!r}) names no metric. Write metric=..., the column of what was measured."
            )
        if self.step and self.columns.get(STEPS, self.step) != self.step:
            raise UserError(
                f"Imported({str(self.path)!r}) has two columns of environment steps: {self.columns[STEPS]!r} and "
                f"step={self.step!r}. Name the metric otherwise."
            )

    @property
    def columns(self) -> Mapping[str, str]:
        """The columns of the metrics, by the metrics' names."""
        if isinstance(self.metric, Mapping):
            return self.metric
        names = [self.metric] if isinstance(self.metric, str) else self.metric
        return {name: name for name in names if name}

    @cached_property
    def table(self) -> TableFile:
        """The table.

        Raises:
            UserError: when it cannot be read.
        """
        return read_table(self.folder / self.path)

    @cached_property
    def plain(self) -> dict[str, Any]:
        """What the id hashes: the table and how it is read, so that another table is another condition."""
        return {
            "imported": {
                "revision": REVISION,
                "file": self.table.name,
                "sha256": self.table.sha256,
                "by": self.by or "unknown",
                "seed": self.seed,
                "metrics": dict(self.columns),
                "where": dict(self.where),
                "step": self.step,
                "empty_means_diverged": self.empty_means_diverged,
            }
        }

    @cached_property
    def packages(self) -> tuple[str, ...]:
        """None: what has computed the trials is not installed here."""
        return ()

    @property
    def programs(self) -> str:
        """Nothing is compiled."""
        return ""

    @property
    def label(self) -> str:
        """A short name for sentences, such as "runs.csv (algo sac, env hopper)"."""
        chosen = ", ".join(f"{name} {value}" for name, value in self.where.items())
        return f"{Path(self.path).name}{f' ({chosen})' if chosen else ''}"

    @cached_property
    def environment_steps(self) -> int:
        """The steps of the longest curve; 0 without curves."""
        return math.ceil(max((trial.curves[STEPS][-1] for trial in self.existing if trial.curves), default=0.0))

    @cached_property
    def report_distance(self) -> int:
        """Most steps between two reports of a trial, the first of which follows the start; 0 where each is reported."""
        reported = ((0.0, *trial.curves.get(STEPS, ())) for trial in self.existing)
        longest = max((later - earlier for steps in reported for earlier, later in pairwise(steps)), default=0.0)
        return math.ceil(longest) if longest > 1.0 else 0

    @cached_property
    def report_steps(self) -> tuple[float, ...]:
        """Those of the longest curve, if every other is a part of it from the start on; empty if one is not."""
        curves = [trial.curves.get(STEPS, ()) for trial in self.existing]
        longest = max(curves, key=len)
        return longest if all(steps == longest[: len(steps)] for steps in curves) else ()

    @cached_property
    def existing(self) -> tuple[TrialResult, ...]:
        """All trials of the table, at least one, in the order of its seeds.

        Raises:
            UserError: when the table cannot be read, or lacks what it should have.
        """
        return tuple(self._trial(k, seed, rows) for k, (seed, rows) in enumerate(self._rows.by_seed()))

    @cached_property
    def table_rows(self) -> frozenset[tuple[str, int]]:
        """The rows of the table that the trials are read from."""
        return frozenset((self.table.sha256, row) for row in self._rows.chosen)

    @cached_property
    def _rows(self) -> TrialRows:
        return TrialRows(self.table, self.where, self.seed, self.step)

    def _trial(self, number: int, seed: int, rows: Sequence[int]) -> TrialResult:
        """Return the record of one trial: `number` is its seed here, `seed` that of the table."""
        read = {name: self.table.numbers(column, "a metric", rows) for name, column in self.columns.items()}
        metrics = {name: self._final(name, values, rows[-1]) for name, values in read.items()}
        curves: dict[str, tuple[float, ...]] = {}
        if self.step:
            drawn = {name: tuple(math.nan if x is None else x for x in values) for name, values in read.items()}
            curves = {STEPS: tuple(self._rows.steps(rows)), **drawn}
            metrics.setdefault(STEPS, curves[STEPS][-1])
        what, advice = f"Seed {seed} of {self.table.name}", "choose another column, or give the metric another name"
        check_shares(what, metrics, advice)
        check_success(what, *curves.get("success", ()), solves=False, advice=advice)
        status: Status = "done" if all(map(math.isfinite, metrics.values())) else "diverged"
        spec = TrialSpec(self, number)
        return TrialResult(
            id=spec.id,
            condition=self.id,
            spec=spec.plain,
            seed=number,
            status=status,
            metrics=metrics,
            levels={},
            curves=curves,
            digest=digest(status, metrics, {}, curves, b""),
            timing={"run": 0.0, "compile": 0.0, "batch": 1, "started": ""},  # of which the table says nothing
            provenance={
                "imported": {name: self.plain["imported"][name] for name in ("file", "sha256", "by")},
                "seed_in_table": str(seed),  # a record's numbers have as many digits as a counter
                "versions": {"evoclaims": version_of("evoclaims")},
                DEPENDS_ON: [],
            },
        )

    def _final(self, name: str, values: Sequence[float | None], row: int) -> float:
        """Return the last number of a metric; NaN for a trial that diverged."""
        if self.empty_means_diverged and values[-1] is None:
            return math.nan
        found = [value for value in values if value is not None]
        if found:
            return found[-1]
        raise UserError(
            f"{self.table.name} has no number in row {row + 1} of the column {self.columns[name]!r}: write nan for a "
            "trial that diverged, or say empty_means_diverged=True if all empty cells mean that."
        )


def into_store(condition: Condition, seeds: Sequence[int], store: Store) -> list[TrialResult]:
    """Return the existing trials of some seeds, as far as there are any, after writing what a store lacks into it.

    Raises:
        UserError: when the table cannot be read, or the store is damaged or cannot be written.
    """
    found = [condition.existing[seed] for seed in seeds if seed < len(condition.existing)]
    lacking = [trial for trial in found if store.made_with(trial.id, condition.versions) is None]
    if lacking:
        store.check_writable()
    for trial in lacking:
        store.put(trial, {})
    return found


def where_from(condition: Condition) -> str:
    """Say how many trials exist and where they come from, as a clause."""
    count, digits = len(condition.existing), condition.plain.get("imported", {}).get("sha256", "")[:12]
    trials = "1 trial is" if count == 1 else f"{count} trials are"
    return f"{trials} imported from {condition.label}, sha256 {digits}"
