"""Drift: new trials compared with earlier ones of the same condition, by method, then condition, then measure."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.canonical import as_plain
from evoclaims.judging.changed_settings import changed_settings
from evoclaims.judging.effect import a12, median
from evoclaims.judging.exact import rank_attainable, rank_test
from evoclaims.judging.multiplicity import holm
from evoclaims.judging.sample import UnreadableTrialError, read_number
from evoclaims.trials.result import TrialResult

ALPHA = 0.01
MIN_REFERENCES = 10
RESOLUTION = 1e-6
"""Relative difference up to which two trials' numbers count as equal: eight times the precision of float32."""

PERMUTATIONS: Final = 19_999
"""Fewest of a joint test, whose p is at least about 3 / 20,000; with many methods there are more (see `_enough`)."""

SEED: Final = 20251126
"""Fixed, so that the same trials always give the same p."""

FOUND: Final = 0.95
"""Probability with which a shift is called detectable."""

LOWER: Final = ("environment_steps", "steps")
"""Measures that are better when they are lower, so that the sum over conditions knows what "better" is."""

_LEVEL: Final = re.compile(r"(\w+) at level (\d+)")
_CURVE: Final = re.compile(r"mean (\w+) while training")

DriftStatus = Literal["no drift", "drift", "underpowered", "no reference", "not run", "error"]
"""Only "no drift" is a pass; "underpowered": no values could have shown drift after the correction."""


@dataclass(frozen=True)
class DriftCase:
    """One condition to check.

    Attributes:
        label: a short name, such as "cma_es on n_parity".
        condition: the condition's id; references of another id are ignored (their code or budget differs).
        new: new trials.
        reference: earlier trials.
        pilot: more of them, of other seeds, which have some of the measures alone.
        metrics: names of measures (see `measured`).
        edited: what is not the same in the table that the trials were imported from, as a clause; empty if nothing.
        method: conditions of one method are tested together; the label where it is empty.
        group: what may have changed, such as "evosax 0.3.2 -> 0.3.3"; each group is corrected for itself.
    """

    label: str
    condition: str
    new: tuple[TrialResult, ...]
    reference: tuple[TrialResult, ...]
    metrics: tuple[str, ...]
    edited: str = ""
    method: str = ""
    group: str = ""
    pilot: tuple[TrialResult, ...] = ()


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
    """

    rows: tuple[DriftRow, ...]
    alpha: float
    edited: tuple[str, ...] = ()
    detectable: Mapping[str, float] = field(default_factory=dict)

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
    def counts(self) -> str:
        """How many measures and methods were tested, how many of these drifted, and how."""
        drifted = sum(row.drifted for row in self.rows)
        how = f"by method, permutation tests, Holm, α = {self.alpha:g}"
        return f"{self.tested} comparisons, {drifted} drifted ({how})"

    @property
    def nearest(self) -> DriftRow | None:
        """The tested row with the smallest p of its method, and then of its own; None if nothing was tested."""
        tested = [row for row in self.rows if row.p_holm is not None and row.p is not None]
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

    def about(self, labels: Collection[str]) -> DriftReport:
        """Return the part about some conditions."""
        return replace(self, rows=tuple(row for row in self.rows if row.label in labels))

    @property
    def unchecked(self) -> tuple[DriftRow, ...]:
        """Rows that show neither drift nor no drift; they do not pass."""
        return tuple(row for row in self.rows if row.status not in ("no drift", "drift"))

    def to_json(self) -> dict[str, Any]:
        """Return the report as strict JSON."""
        plain: dict[str, Any] = as_plain(self)
        return plain


def check_drift(cases: Sequence[DriftCase], alpha: float = ALPHA) -> DriftReport:
    """Test whether trials have drifted: methods first, then their conditions and measures.

    A method is tested by all measures of all its conditions jointly (see `_joint`), with Holm's correction over the
    methods of a group of cases. Conditions of a method that drifted, and their measures, are only distinguished:
    by Holm over them, or else the one with the smallest p is named.

    A failed trial ranks below all others. Cases whose trials are the references' own, to the bit, need no test, and
    count for no correction. `alpha` is the familywise error of each group.
    """
    rows: list[DriftRow] = []
    detectable: dict[str, float] = {}
    for group in dict.fromkeys(case.group for case in cases):
        mine = [case for case in cases if case.group == group]
        prepared = [_prepared(case) for case in mine]
        families: dict[str, list[_Columns]] = {}
        for case, (conditions, _) in zip(mine, prepared, strict=True):
            if conditions:
                families.setdefault(case.method or case.label, []).extend(conditions)
        count = _enough(len(families), alpha)
        adjusted = dict(zip(families, holm([_by_blocks(those, count) for those in families.values()]), strict=True))
        places = {name: _places(those, count) for name, those in families.items() if adjusted[name] <= alpha}
        for name, those in families.items():
            detectable[name] = max(detectable.get(name, 0.0), _detectable(those, alpha / len(families)))
        for case, (conditions, without) in zip(mine, prepared, strict=True):
            name = case.method or case.label
            for row in (row for one in conditions for row in one.rows):
                shown = (row.label, row.metric) in places.get(name, ())
                rows.append(_decided(row, adjusted[name], shown, alpha, len(families)))
            rows += without
    edited = tuple(f"{case.label}: {case.edited}" for case in cases if case.edited)
    return DriftReport(tuple(rows), alpha, edited, detectable)


@dataclass(frozen=True, eq=False)
class _Columns:
    """What is tested of a condition: measures that the same trials have.

    Attributes:
        rows: of its measures that are not constant, each with its own exact two-sided p; at least one.
        centred: mid-ranks minus their mean, by trial, new ones first, and measure; shape [n_new + n_ref, measures].
        n: number of new trials.
        wide: whether the pilot's trials are among the earlier ones.
    """

    rows: tuple[DriftRow, ...]
    centred: NDArray[np.float64]
    n: int
    wide: bool

    @property
    def spread(self) -> NDArray[np.float64]:
        """The standard deviation of the sum of the new trials' ranks, shape [measures]."""
        total = len(self.centred)
        variance = (self.centred**2).sum(axis=0) * self.n * (total - self.n) / (total * (total - 1))
        return np.asarray(np.sqrt(np.where(variance > 0, variance, 1.0)))


def measured(trial: TrialResult, name: str) -> float:
    """Return a measure of a finished trial: a metric, "success at level 2", or "mean fitness while training".

    Raises:
        KeyError: when the trial lacks it.
    """
    if name in trial.metrics:
        return trial.metrics[name]
    if curve := _CURVE.fullmatch(name):
        values = trial.curves[curve[1]]
        return math.fsum(values) / max(len(values), 1)
    if level := _LEVEL.fullmatch(name):
        values = trial.levels[level[1]]
        if int(level[2]) < len(values):
            return values[int(level[2])]
    raise KeyError(name)


def _prepared(case: DriftCase) -> tuple[list[_Columns], list[DriftRow]]:
    """Return what is tested of a condition, and rows that say why there is no test."""
    new = [trial for trial in case.new if trial.condition == case.condition]
    reference = [trial for trial in case.reference if trial.condition == case.condition]

    def row(metric: str, status: DriftStatus, detail: str = "") -> DriftRow:
        return DriftRow(case.label, metric, len(new), len(reference), status, detail=detail)

    def every(status: DriftStatus, detail: str) -> list[DriftRow]:
        return [row(metric, status, detail) for metric in case.metrics]

    if not new:
        return [], every("not run", "no new trial of this condition")
    if len(reference) < MIN_REFERENCES:
        others = [trial for trial in case.reference if trial.condition != case.condition]
        changed = changed_settings(others[-1].spec, new[-1].spec) if others else ""
        why = f": {changed}" if changed else ""
        left_out = f" ({len(others)} of another fingerprint left out{why})" if others else ""
        few = f"{len(reference)} reference trials of this condition, {MIN_REFERENCES} needed{left_out}"
        return [], every("no reference", few)
    crashed = [trial.seed for trial in (*new, *reference) if trial.status == "crashed"]
    if crashed:
        return [], every("error", f"trials crashed: seeds {', '.join(map(str, crashed))}")
    before = {trial.seed: trial.digest for trial in reference if trial.digest}
    if all(trial.digest and before.get(trial.seed) == trial.digest for trial in new):
        return [], every("no drift", "the same trials to the bit")
    pilot = [trial for trial in case.pilot if trial.status == "done"]
    known = [metric for metric in case.metrics if pilot and all(_has(trial, metric) for trial in pilot)]
    rest = [metric for metric in case.metrics if metric not in known]
    blocks = [(known, (*reference, *case.pilot), True), (rest, tuple(reference), False)]
    read = [_columns(case.label, metrics, new, earlier, wide) for metrics, earlier, wide in blocks if metrics]
    conditions, without = [one for one, _ in read if one], [row for _, rows in read for row in rows]
    constant = [row for row in without if row.status == "no drift"]
    if conditions or len(constant) < len(without):
        return conditions, [row for row in without if row.status != "no drift"]
    return [], constant[:1]


def _has(trial: TrialResult, metric: str) -> bool:
    """Whether a trial has a measure."""
    try:
        measured(trial, metric)
    except KeyError:
        return False
    return True


def _columns(
    label: str, metrics: Sequence[str], new: Sequence[TrialResult], earlier: Sequence[TrialResult], wide: bool
) -> tuple[_Columns | None, list[DriftRow]]:
    """Return those of some measures that vary, and rows of those that do not or that cannot be read."""
    from scipy.stats import rankdata  # as in `judging.exact`

    tested: list[DriftRow] = []
    without: list[DriftRow] = []
    ranks: list[NDArray[np.float64]] = []
    for metric in metrics:
        row = DriftRow(label, metric, len(new), len(earlier), "no drift")
        try:
            sides = [[_number(trial, label, metric) for trial in side] for side in (new, earlier)]
        except (UnreadableTrialError, KeyError) as error:
            lacking = isinstance(error, KeyError)
            detail = f"a finished trial has no metric {metric!r}" if lacking else str(error)
            without.append(replace(row, status="error", detail=detail))
            continue
        values, stored = _as_exact_as_float32(*sides)
        p = min(1.0, 2 * min(rank_test(values, stored).p, rank_test(stored, values).p))
        found = replace(row, p=p, a12=a12(values, stored), median_new=median(values), median_ref=median(stored))
        ranked = rankdata([*values, *stored])
        ranked = (ranked - ranked.mean()) * (-1 if metric in LOWER else 1)
        if np.any(ranked):
            tested.append(found)
            ranks.append(ranked)
        else:
            without.append(replace(found, p_holm=1.0))
    return (_Columns(tuple(tested), np.stack(ranks, axis=1), len(new), wide) if tested else None), without


def _number(trial: TrialResult, label: str, metric: str) -> float:
    """Return a measure of a trial; the lowest number for one that failed."""
    return read_number(trial, f"{label}: {metric}", lambda one: measured(one, metric), -math.inf)


def _enough(families: int, alpha: float) -> int:
    """Return a number of permutations with which p can be half of what Holm's correction and two blocks ask for."""
    return max(PERMUTATIONS, math.ceil(2 * 3 * 2 * families / alpha))


def _by_blocks(conditions: Sequence[_Columns], count: int) -> float:
    """Return the p that nothing changed: the smaller of two, doubled, where some measures alone are in pilots."""
    blocks = [those for wide in (True, False) if (those := [one for one in conditions if one.wide is wide])]
    return min(1.0, len(blocks) * min(_joint(those, count) for those in blocks))


def _joint(conditions: Sequence[_Columns], count: int) -> float:
    """Return the p of the hypothesis that nothing changed in some conditions.

    A single measure of a single condition has its exact p. Else new and earlier trials are exchanged at random, whole
    trials within each condition, `count` times with a fixed seed. Three statistics of the measures' rank sums z
    look for three kinds of change: the sum over conditions (all better, or all worse), the sum of squares (anything),
    and the largest (one alone). Their smallest p is itself compared with its distribution over the permutations, so
    that p is valid for any dependence of measures.
    """
    if len(conditions) == 1 and len(conditions[0].rows) == 1:
        return conditions[0].rows[0].p or 1.0
    rng = np.random.default_rng(SEED)
    sums = np.zeros(count + 1)
    squares, largest = np.zeros_like(sums), np.zeros_like(sums)
    for one in conditions:
        chosen = np.argpartition(rng.random((count, len(one.centred))), one.n, axis=1)[:, : one.n]
        observed = one.centred[: one.n].sum(axis=0)[None]
        z = np.concatenate([observed, one.centred[chosen].sum(axis=1)]) / one.spread
        together = z.sum(axis=1)
        sums += together / max(float(together.std()), 1e-12)
        squares += (z**2).mean(axis=1)
        largest = np.maximum(largest, np.abs(z).max(axis=1))
    statistics = np.round([np.abs(sums), squares, largest], 9)  # equal ones, whatever the order of their sums
    smallest = np.min([_share_above(statistic) for statistic in statistics], axis=0)
    return float(np.mean(smallest <= smallest[0]))


def _share_above(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return for each value the share of values that are at least as large."""
    order = np.sort(values)
    return np.asarray(1 - np.searchsorted(order, values, side="left") / len(values))


def _places(conditions: Sequence[_Columns], count: int) -> set[tuple[str, str]]:
    """Return where a method's drift shows, by label and measure: what Holm's correction finds, at least one."""
    joint = [_joint([one], count) for one in conditions]
    found = [one for one, p in zip(conditions, holm(joint), strict=True) if p <= ALPHA]
    found = found or [conditions[int(np.argmin(joint))]]
    rows = [row for one in found for row in one.rows]
    ps = holm([row.p or 1.0 for row in rows])
    sure = {(row.label, row.metric) for row, p in zip(rows, ps, strict=True) if p <= ALPHA}
    return sure | {min((row.p or 1.0, row.label, row.metric) for row in one.rows)[1:] for one in found}


def _detectable(conditions: Sequence[_Columns], alpha: float) -> float:
    """Return the shift of all measures, in standard deviations, that is found with probability `FOUND`.

    The normal approximation of the sum over conditions, at a third of alpha for each of three statistics; of normal
    values, a rank sum loses 1 - 3/π of the information.
    """
    from scipy.stats import norm  # as in `judging.exact`

    sides = {one.wide for one in conditions}
    conditions = [one for one in conditions if one.wide is max(sides)]
    z = float(norm.isf(alpha / (2 * 3 * len(sides))) + norm.ppf(FOUND))
    means = [math.sqrt(3 / math.pi * one.n * (len(one.centred) - one.n) / (len(one.centred) + 1)) for one in conditions]
    return z * math.sqrt(len(conditions)) / math.fsum(means)


def _decided(row: DriftRow, p_holm: float, shown: bool, alpha: float, families: int) -> DriftRow:
    """Return a tested row with its status, given its method's adjusted p, and whether its drift shows there."""
    smallest = 2 * rank_attainable(row.n_new, row.n_ref) * families
    if p_holm <= alpha or smallest <= alpha:
        return replace(row, status="drift" if shown else "no drift", p_holm=p_holm)
    detail = (
        f"the smallest p that {row.n_new} against {row.n_ref} trials allow is {smallest:.3g} "
        f"after correction for {families} methods"
    )
    return replace(row, status="underpowered", p_holm=p_holm, detail=detail)


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
