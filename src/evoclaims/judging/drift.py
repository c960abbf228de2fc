"""Drift: new trials compared with earlier ones of the same condition, by method, then condition, then measure."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.printable import printable
from evoclaims.core.source_code import CODE
from evoclaims.judging.drift_report import DriftReport, DriftRow, DriftStatus
from evoclaims.judging.effect import a12, median
from evoclaims.judging.exact import holm, rank_attainable, two_sided_rank_p
from evoclaims.judging.joint_test import Columns, detectable_shift, p_by_blocks, permutations_for, places_of
from evoclaims.judging.sample import RESOLUTION, UnreadableTrialError, read_number
from evoclaims.trials.result import TrialResult

MOST: Final = 5
"""Most settings that a sentence lists."""


def changed_settings(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    """Return the settings that differ, such as "method.settings.sigma 0.5 -> 0.3"; empty if none does.

    The seed is no setting; "none" stands for a setting that one side does not have. Of an edited robot only a
    hash of its model is known, so its file is named.
    """
    before, after = (dict(_leaves("", {**spec, "seed": None})) for spec in (old, new))
    names = sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))
    shown = []
    for name in names:
        file, both = f"{name.removesuffix('.body')}.xml", before.keys() & after.keys()
        if not name.endswith(".body") or not {name, file} <= both:
            shown.append(f"{name} {before.get(name, 'none')} -> {after.get(name, 'none')}")
        elif file not in names:  # otherwise another file has another model anyway
            shown.append(f"{file} {after[file]}: this file, or one that it includes, was edited")
    more = [f"and {len(shown) - MOST} more"] if len(shown) > MOST else []
    return printable(", ".join([*shown[:MOST], *more]))


def _leaves(name: str, value: Any) -> Iterator[tuple[str, str]]:
    """Yield what a nested table holds, as texts by dotted names; an empty table or list is a value."""
    parts = value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list | tuple) else ()
    found = [leaf for key, part in parts for leaf in _leaves(f"{name}.{key}" if name else str(key), part)]
    yield from found or [(name, repr(value))]


ALPHA = 0.01
MIN_REFERENCES = 10
LOWER: Final = ("environment_steps", "steps")
"""Measures that are better when they are lower, so that the sum over conditions knows what "better" is."""

_LEVEL: Final = re.compile(r"(\w+) at level (\d+)")
_CURVE: Final = re.compile(r"mean (\w+) while training")


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


def check_drift(cases: Sequence[DriftCase], alpha: float = ALPHA) -> DriftReport:
    """Test whether trials have drifted: methods first, then their conditions and measures.

    A method is tested by all measures of all its conditions jointly (see `joint_p`), with Holm's correction over the
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
        families: dict[str, list[Columns]] = {}
        for case, (conditions, _) in zip(mine, prepared, strict=True):
            if conditions:
                families.setdefault(case.method or case.label, []).extend(conditions)
        count = permutations_for(len(families), alpha)
        adjusted = dict(zip(families, holm([p_by_blocks(those, count) for those in families.values()]), strict=True))
        places = {name: places_of(those, count, alpha) for name, those in families.items() if adjusted[name] <= alpha}
        for name, those in families.items():
            detectable[name] = max(detectable.get(name, 0.0), detectable_shift(those, alpha / len(families)))
        for case, (conditions, without) in zip(mine, prepared, strict=True):
            name = case.method or case.label
            for row in (row for one in conditions for row in one.rows):
                shown = (row.label, row.metric) in places.get(name, ())
                rows.append(_decided(row, adjusted[name], shown, alpha, len(families)))
            rows += without
    edited = tuple(f"{case.label}: {case.edited}" for case in cases if case.edited)
    return DriftReport(tuple(rows), alpha, edited, detectable)


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


def _prepared(case: DriftCase) -> tuple[list[Columns], list[DriftRow]]:
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
    before = {trial.seed: trial.digest for trial in reference}
    again = [trial for trial in new if trial.seed in before]  # of other seeds there is nothing to compare bits with
    alike = [trial for trial in again if trial.digest and before[trial.seed] == trial.digest]
    if again and len(alike) == len(again) and all(by_one_code(again[0], trial) for trial in new):
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


def by_one_code(one: TrialResult, other: TrialResult) -> bool:
    """Whether two trials were made by the same code, as far as they tell: a store may mix those of several versions."""
    return all(one.provenance.get(part) == other.provenance.get(part) for part in ("versions", "git", CODE))


def _has(trial: TrialResult, metric: str) -> bool:
    try:
        measured(trial, metric)
    except KeyError:
        return False
    return True


def _columns(
    label: str, metrics: Sequence[str], new: Sequence[TrialResult], earlier: Sequence[TrialResult], wide: bool
) -> tuple[Columns | None, list[DriftRow]]:
    """Return those of some measures that vary, and rows of those that do not or that cannot be read."""
    from scipy.stats import rankdata  # as in `judging.exact`

    tested: list[DriftRow] = []
    without: list[DriftRow] = []
    ranks: list[NDArray[np.float64]] = []
    for metric in metrics:
        row = DriftRow(label, metric, len(new), len(earlier), "no drift")
        try:
            sides = [[_number_of(trial, label, metric) for trial in side] for side in (new, earlier)]
        except (UnreadableTrialError, KeyError) as error:
            lacking = isinstance(error, KeyError)
            detail = f"a finished trial has no metric {metric!r}" if lacking else str(error)
            without.append(replace(row, status="error", detail=detail))
            continue
        values, stored = _as_exact_as_float32(*sides)
        p = two_sided_rank_p(values, stored)
        found = replace(row, p=p, a12=a12(values, stored), median_new=median(values), median_ref=median(stored))
        ranked = rankdata([*values, *stored])
        ranked = (ranked - ranked.mean()) * (-1 if metric in LOWER else 1)
        if np.any(ranked):
            tested.append(found)
            ranks.append(ranked)
        else:
            without.append(replace(found, p_holm=1.0))
    trials = tuple((side, trial.seed) for side, those in (("new", new), ("earlier", earlier)) for trial in those)
    return (Columns(tuple(tested), np.stack(ranks, axis=1), len(new), trials, wide) if tested else None), without


def _number_of(trial: TrialResult, label: str, metric: str) -> float:
    """Return a measure of a trial; the worst number for one that failed.

    Raises:
        KeyError: when a finished trial lacks it.
        UnreadableTrialError: when it is NaN.
    """
    worst = math.inf if metric in LOWER else -math.inf
    return read_number(trial, f"{label}: {metric}", lambda one: measured(one, metric), worst)


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
