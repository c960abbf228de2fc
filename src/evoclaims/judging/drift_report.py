"""What comparisons with earlier trials have found: of drift, a row for each measure; and digests that have changed."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

from evoclaims.core.canonical import as_plain
from evoclaims.core.provenance import same_bits
from evoclaims.trials.result import TrialResult

FOUND: Final = 0.95
"""Probability with which a shift is called detectable."""

DriftStatus = Literal["no drift", "drift", "not repeated", "underpowered", "no reference", "not run", "error"]
"""Only "no drift" is a pass. "not repeated": a drift that more trials, with fresh seeds, have not shown again;
"underpowered": no values could have shown drift after the correction."""


@dataclass(frozen=True)
class DriftRow:
    """One metric of one condition.

    Attributes:
        label: names the condition.
        metric: what was compared.
        n_new, n_ref: numbers of new trials and of reference trials.
        status: result of the comparison.
        p: two-sided; None if not tested.
        p_holm: of its method's joint test, Holm-adjusted over the methods: what decides.
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
            f"{self.label}: {self.metric}{f' is {way} now' * self.drifted}: median {self.median_ref:.6g} -> "
            f"{self.median_new:.6g}, "
            f"A12 = {self.a12:.2f}, p = {self.p_holm:.2g} (Holm)"
        )


@dataclass(frozen=True)
class DriftReport:
    """One row per condition and measure, judged together at `alpha`, and edited tables, which need no test.

    Attributes:
        rows: those of a method that drifted have the status "drift" where the drift shows most.
        alpha: familywise error of each group of cases.
        edited: a clause for each edited table.
        detectable: by method that was tested, the shift of all its conditions, in standard deviations, that this
            check finds with a probability of 0.95.
        repetitions: what trials with fresh seeds of methods that drifted have shown, or why there are none.
    """

    rows: tuple[DriftRow, ...]
    alpha: float
    edited: tuple[str, ...] = ()
    detectable: Mapping[str, float] = field(default_factory=dict)
    repetitions: tuple[str, ...] = ()

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
        """A line for each row that drifted, each repetition, each edited table, and each condition without a check."""
        edited = [f"EDITED {line}" for line in self.edited]
        drifted = [f"DRIFT in {row.in_words}" for row in self.rows if row.drifted]
        drifted += [f"not repeated: {row.in_words}" for row in self.rows if row.status == "not repeated"]
        unchecked = (f"not checked: {row.label}: {row.detail or row.status}" for row in self.unchecked)
        return [*drifted, *self.repetitions, *edited, *dict.fromkeys(unchecked)]

    @property
    def counts(self) -> str:
        """How many measures and methods were tested, how many of these drifted, and how."""
        drifted = sum(row.drifted for row in self.rows)
        how = f"by method, permutation tests, Holm, α = {self.alpha:g}"
        return f"{self.tested} comparisons, {drifted} drifted ({how})"

    @property
    def nearest(self) -> DriftRow | None:
        """The tested row of no method that drifted with the smallest p of its method, and then of its own; or None."""
        tested = [row for row in self.rows if row.p_holm is not None and row.p is not None and row.p_holm > self.alpha]
        return min(tested, key=lambda row: (row.p_holm, row.p), default=None)

    @property
    def limits(self) -> str:
        """What this check could have found, in words; empty if nothing was tested."""
        shifts: dict[str, list[str]] = {}
        for method, shift in sorted(self.detectable.items(), key=lambda one: one[1]):
            shifts.setdefault(f"{shift:.1f} SD", []).append(method)
        found = ", ".join(f"{shift} in {', '.join(methods)}" for shift, methods in shifts.items())
        return f"with probability {FOUND:g} a shift of all conditions by {found}" if found else ""

    @property
    def undecided(self) -> str:
        """Where no drift is shown: the nearest comparison, and what could have been found. No drift is never shown."""
        near = f"no drift shown; nearest: {self.nearest.in_words}" if self.nearest else "no drift shown"
        return f"{near}; found would have been {self.limits}" if self.limits else near

    def repeated_by(self, again: DriftReport, method: str, labels: Collection[str]) -> DriftReport:
        """Return this report once trials with fresh seeds were tested, of all conditions of a method that drifted."""
        numbers = sorted({row.n_new for row in again.rows})
        several = " to ".join(str(number) for number in dict.fromkeys((numbers[0], numbers[-1])))
        fresh = f"{several} trials of each condition of {method}, with fresh seeds"
        if again.drifted or again.unchecked:
            return self.standing(f"{fresh}: {again.lines[0]}")
        mine = {row for row in self.rows if row.drifted and row.label in labels}
        rows = [replace(row, status="not repeated") if row in mine else row for row in self.rows]
        return replace(self, rows=tuple(rows), repetitions=(*self.repetitions, f"  {fresh}: {again.undecided}"))

    def standing(self, why: str) -> DriftReport:
        """Return this report with the reason why a drift stands."""
        return replace(self, repetitions=(*self.repetitions, f"  it stands: {why}"))

    def about(self, labels: Collection[str]) -> DriftReport:
        """Return the part about some conditions."""
        return replace(self, rows=tuple(row for row in self.rows if row.label in labels))

    @property
    def unchecked(self) -> tuple[DriftRow, ...]:
        """Rows that show neither drift nor no drift; they do not pass."""
        return tuple(row for row in self.rows if row.status not in ("no drift", "drift", "not repeated"))

    def to_json(self) -> dict[str, Any]:
        """Return the report as strict JSON."""
        plain: dict[str, Any] = as_plain(self)
        return plain


@dataclass(frozen=True)
class DigestChange:
    """A trial whose digest has changed, which need not mean that it is wrong."""

    condition: str
    seed: int
    was: str
    now: str


@dataclass(frozen=True)
class DigestCheck:
    """What the tripwire found.

    Attributes:
        compared: new trials with a comparable reference; if 0, the check shows nothing.
        changed: those of them whose digest differs.
    """

    compared: int
    changed: tuple[DigestChange, ...]


def compare_digests(new: Sequence[TrialResult], reference: Sequence[TrialResult]) -> DigestCheck:
    """Compare digests of trials of the same condition and seed that should have the same bits."""
    stored: dict[tuple[str, int], list[TrialResult]] = {}
    for old in reference:
        stored.setdefault((old.condition, old.seed), []).append(old)
    pairs = [
        (trial, old)
        for trial in new
        for old in stored.get((trial.condition, trial.seed), ())
        if same_bits(trial.provenance, old.provenance)
    ]
    changed = tuple(
        DigestChange(trial.condition, trial.seed, old.digest, trial.digest)
        for trial, old in pairs
        if trial.digest != old.digest
    )
    return DigestCheck(len(pairs), changed)
