"""Drift: new trials compared with committed reference trials of the same condition."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from evoclaims.core.canonical import as_plain
from evoclaims.judging.effect import a12, median
from evoclaims.judging.exact import rank_attainable, rank_test
from evoclaims.judging.multiplicity import holm
from evoclaims.judging.sample import UnreadableTrialError, read_number
from evoclaims.trials.result import TrialResult

ALPHA = 0.01
MIN_REFERENCES = 10
RESOLUTION = 1e-6
"""Relative difference up to which two trials' numbers count as equal: eight times the precision of float32."""

DriftStatus = Literal["no drift", "drift", "underpowered", "no reference", "not run", "error"]
"""Only "no drift" is a pass; "underpowered": no values could have shown drift after the correction."""


@dataclass(frozen=True)
class DriftCase:
    """One condition to check.

    Attributes:
        label: a short name, such as "cma_es on n_parity".
        condition: the condition's id; references of another id are ignored (their code or budget differs).
        new: new trials.
        reference: committed trials.
        metrics: names in `TrialResult.metrics`.
        edited: what is not the same in the table that the trials were imported from, as a clause; empty if nothing.
    """

    label: str
    condition: str
    new: tuple[TrialResult, ...]
    reference: tuple[TrialResult, ...]
    metrics: tuple[str, ...]
    edited: str = ""


@dataclass(frozen=True)
class DriftRow:
    """One metric of one condition.

    Attributes:
        label: names the condition.
        metric: what was compared.
        n_new, n_ref: numbers of new trials and of reference trials.
        status: result of the comparison.
        p: two-sided; None if not tested.
        p_holm: the same, Holm-adjusted.
        detail: why there was no test, or what the test could not have shown.
        a12: Vargha and Delaney's effect: the chance that a new trial is above a reference, ties counting half; None if
            not tested.
        median_new, median_ref: of each side; None if not tested.
    """

    label: str
    metric: str
    n_new: int
    n_ref: int
    status: DriftStatus
    p: float | None = None
    p_holm: float | None = None
    detail: str = ""
    a12: float | None = None
    median_new: float | None = None
    median_ref: float | None = None

    @property
    def drifted(self) -> bool:
        """Whether the suite-wide test found a drift."""
        return self.status == "drift"

    @property
    def in_words(self) -> str:
        """A tested row as one line: direction, effect and p."""
        if self.a12 is None or self.p_holm is None:
            return f"{self.label}: {self.metric}: {self.detail or self.status}"
        way = "higher" if self.a12 > 0.5 else "lower" if self.a12 < 0.5 else "spread otherwise"
        return (
            f"{self.label}: {self.metric} is {way} now: median {self.median_ref:.6g} -> {self.median_new:.6g}, "
            f"A12 = {self.a12:.2f}, p = {self.p_holm:.2g} (Holm)"
        )


@dataclass(frozen=True)
class DriftReport:
    """One row per condition and metric, judged together at `alpha`, and edited tables, which need no test."""

    rows: tuple[DriftRow, ...]
    alpha: float
    edited: tuple[str, ...] = ()

    @property
    def drifted(self) -> bool:
        """Whether any row drifted."""
        return any(row.drifted for row in self.rows)

    @property
    def tested(self) -> int:
        """How many rows show drift or no drift."""
        return len(self.rows) - len(self.unchecked)

    @property
    def lines(self) -> list[str]:
        """A line for each row that drifted, each edited table, and each condition that could not be checked."""
        edited = [f"EDITED {line}" for line in self.edited]
        drifted = [f"DRIFT in {row.in_words}" for row in self.rows if row.drifted]
        unchecked = (f"not checked: {row.label}: {row.detail or row.status}" for row in self.unchecked)
        return [*drifted, *edited, *dict.fromkeys(unchecked)]

    @property
    def unchecked(self) -> tuple[DriftRow, ...]:
        """Rows that show neither drift nor no drift; they do not pass."""
        return tuple(row for row in self.rows if row.status not in ("no drift", "drift"))

    def to_json(self) -> dict[str, Any]:
        """Return the report as strict JSON."""
        plain: dict[str, Any] = as_plain(self)
        return plain


def check_drift(cases: Sequence[DriftCase], alpha: float = ALPHA) -> DriftReport:
    """Test every metric of every case: exact two-sided rank test, Holm over all rows that could be tested.

    A failed trial ranks below all others. If the code is unchanged, new trials with seeds of references repeat them;
    such ties only make the test more conservative. `alpha` is the familywise error of the whole report.
    """
    rows = [_test(case, metric) for case in cases for metric in case.metrics]
    tested = [row.p for row in rows if row.p is not None]
    adjusted = iter(holm(tested))
    corrected = (row if row.p is None else _corrected(row, next(adjusted), len(tested), alpha) for row in rows)
    edited = tuple(f"{case.label}: {case.edited}" for case in cases if case.edited)
    return DriftReport(tuple(corrected), alpha, edited)


def _test(case: DriftCase, metric: str) -> DriftRow:
    """Run the rank test of one metric, without Holm's correction, or return a row that says why it cannot run."""
    new = [trial for trial in case.new if trial.condition == case.condition]
    reference = [trial for trial in case.reference if trial.condition == case.condition]

    def row(status: DriftStatus, detail: str) -> DriftRow:
        return DriftRow(case.label, metric, len(new), len(reference), status, detail=detail)

    if not new:
        return row("not run", "no new trial of this condition")
    if len(reference) < MIN_REFERENCES:
        others = len(case.reference) - len(reference)
        return row(
            "no reference",
            f"{len(reference)} reference trials of this condition, {MIN_REFERENCES} needed"
            + (f" ({others} of another fingerprint left out)" if others else ""),
        )
    crashed = [trial.seed for trial in (*new, *reference) if trial.status == "crashed"]
    if crashed:
        return row("error", f"trials crashed: seeds {', '.join(map(str, crashed))}")
    if any(trial.status == "done" and metric not in trial.metrics for trial in (*new, *reference)):
        return row("error", f"a finished trial has no metric {metric!r}")
    try:
        values, stored = (
            [read_number(trial, f"{case.label}: {metric}", lambda t: t.metrics[metric], -math.inf) for trial in side]
            for side in (new, reference)
        )
    except UnreadableTrialError as error:
        return row("error", str(error))
    values, stored = _as_exact_as_float32(values, stored)
    p = min(1.0, 2 * min(rank_test(values, stored).p, rank_test(stored, values).p))
    return replace(
        row("no drift", ""), p=p, a12=a12(values, stored), median_new=median(values), median_ref=median(stored)
    )


def _as_exact_as_float32(*sides: Sequence[float]) -> list[list[float]]:
    """Return the values, with those made equal that differ by no more than float32 rounding (see `RESOLUTION`).

    Two releases may round the same mean to neighbouring numbers; in ranks, one side could then be above in all trials.
    """
    exact: dict[float, float] = {}
    last = -math.inf
    for value in sorted({value for side in sides for value in side}):
        bounded = math.isfinite(last) and math.isfinite(value)
        near = bounded and value - last <= RESOLUTION * max(abs(value), abs(last))
        exact[value] = exact[last] if near else value
        last = value
    return [[exact[value] for value in side] for side in sides]


def _corrected(row: DriftRow, p_holm: float, tests: int, alpha: float) -> DriftRow:
    """Return a tested row with its status, given its adjusted p."""
    smallest = 2 * rank_attainable(row.n_new, row.n_ref) * tests
    if p_holm <= alpha or smallest <= alpha:
        return replace(row, status="drift" if p_holm <= alpha else "no drift", p_holm=p_holm)
    detail = (
        f"the smallest p that {row.n_new} against {row.n_ref} trials allow is {smallest:.3g} "
        f"after correction for {tests} tests"
    )
    return replace(row, status="underpowered", p_holm=p_holm, detail=detail)
