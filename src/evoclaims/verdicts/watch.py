"""A watch: the trials of many nights, with new seeds each, against the committed ones, by families of conditions."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UserError
from evoclaims.core.packages import Versions, recorded
from evoclaims.judging.drift import LOWER, MIN_REFERENCES, measured
from evoclaims.judging.e_process import (
    Floats,
    evidence,
    evidence_against_constant,
    nights_to_find,
    ranks_of_new,
    standardized_ranks,
    uniform,
)
from evoclaims.judging.effect import a12, median
from evoclaims.judging.sample import RESOLUTION, is_failed
from evoclaims.paper import references
from evoclaims.paper.reproduction import Names
from evoclaims.trials.result import COMPLETE, TrialResult
from evoclaims.trials.spec import Condition
from evoclaims.verdicts.watch_file import Night

ALPHA: Final = 0.05
"""Largest probability that a series of nights, however long, has an alarm although nothing has changed."""

PROCESS: Final = 2
"""Raised when evidence is computed otherwise, which begins a new series."""

MOST_MOVED, SHOWN = 3, 2.5
"""Most measures that an alarm names, and the size of a difference that is named beside the largest: its A12 - 0.5 in
standard deviations of what chance gives."""


@dataclass(frozen=True)
class Watched:
    """A condition with committed trials.

    Attributes:
        names: of method and task.
        condition: what runs.
        seeds: of the committed trials, rising.
        values: what each measure is in them, in the order of seeds; in the reference trials alone if pilots lack it.
        versions: of the packages that they were made with.
        devices: kinds of those that made them, in alphabetical order.
        lacking: seeds of the reference trials that lack a measure of the others, by the measure, which is not watched.
        edited: the project's classes that some of the committed trials ran otherwise, or under another name.
    """

    names: Names
    condition: Condition
    seeds: tuple[int, ...]
    values: Mapping[str, tuple[float, ...]]
    versions: Versions
    devices: tuple[str, ...]
    lacking: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    edited: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """Its name in texts."""
        return " on ".join(self.names)

    def read(self, trials: Iterable[TrialResult]) -> dict[str, tuple[float, ...]]:
        """Return its measures of some trials, each the worst number where a trial has failed or has NaN.

        Raises:
            UserError: when a trial lacks one.
        """
        several, found = tuple(trials), {}
        for name in self.values:
            try:
                found[name] = tuple(_number(trial, name) for trial in several)
            except KeyError as error:
                raise UserError(
                    f"A new trial of {self.label} has no {name!r}, which the committed trials have, so this night is "
                    "not added. Let the method or task measure it again, or write new references."
                ) from error
        return found

    @property
    def whole(self) -> tuple[str, ...]:
        """The measures that all committed trials have."""
        return tuple(name for name, values in self.values.items() if len(values) == len(self.seeds))

    def constant(self, measure: str) -> bool:
        """Whether a measure is the same in all committed trials."""
        values = np.asarray(self.values[measure])
        return not _differ(values, values[0]).any()


def watched(
    names: Names,
    condition: Condition,
    reference: Sequence[TrialResult],
    pilot: Sequence[TrialResult],
    reads: Callable[[TrialResult], Iterable[str]],
) -> Watched | None:
    """Return a condition with those of its committed trials that ran to their end; None if there are fewer than ten.

    Args:
        names: of method and task.
        condition: of this environment.
        reference: its reference trials; those of another condition are left out.
        pilot: of other seeds, which count if made with the same versions.
        reads: returns the names of what claims read of a trial.
    """
    mine = {trial.seed: trial for trial in reference if trial.condition == condition.id and trial.status in COMPLETE}
    done = [trial for trial in mine.values() if trial.status == "done"]
    if len(mine) < MIN_REFERENCES or not done:
        return None
    case = references.paired("", done, tuple(mine.values()), reads=tuple(reads(done[0])), pilot=pilot)
    every = mine | {trial.seed: trial for trial in case.pilot if trial.status in COMPLETE}
    values: dict[str, tuple[float, ...]] = {}
    for those in (every, mine):  # a pilot has only what claims read; what it lacks is watched against references
        for measure in (name for name in case.metrics if name not in values):
            with contextlib.suppress(KeyError):
                values[measure] = tuple(_number(those[seed], measure) for seed in sorted(those))
        if not values:
            every = mine
    versions = recorded(done[-1].provenance, condition.packages)
    devices = kinds_of(every.values())
    known = references.measures(done, {name for one in done for name in reads(one)})
    without = {name: tuple(one.seed for one in done if not _has(one, name)) for name in known}
    lacking = {name: seeds for name, seeds in without.items() if 0 < len(seeds) < len(done)}
    edited = condition.edited_since(every.values())
    found = Watched(names, condition, tuple(sorted(every)), values, versions, devices, lacking, edited)
    return found if values else None


def kinds_of(trials: Iterable[TrialResult]) -> tuple[str, ...]:
    """Return the kinds of the devices that made some trials, in alphabetical order."""
    return tuple(sorted({str(trial.device.get("kind", "unknown")) for trial in trials}))


def _has(trial: TrialResult, measure: str) -> bool:
    try:
        _number(trial, measure)
    except KeyError:
        return False
    return True


def _number(trial: TrialResult, measure: str) -> float:
    """Return a measure of a committed or a new trial, which are read alike; raises a KeyError without it."""
    worst = math.inf if measure in LOWER else -math.inf
    if is_failed(trial):
        return worst
    try:
        value = measured(trial, measure)
    except (ValueError, OverflowError):  # a sum of both infinities
        return worst
    return worst if math.isnan(value) else value


@dataclass(frozen=True)
class Family:
    """Conditions that one change may move together: those of a method, or of a task.

    Attributes:
        label: its name.
        conditions: with committed trials of the same seeds.
        of_method: whether single measures are looked at, too; those of a task are looked at for their methods.
    """

    label: str
    conditions: tuple[Watched, ...]
    of_method: bool

    @property
    def columns(self) -> list[tuple[Watched, str]]:
        """Each measure of each condition."""
        return [(one, measure) for one in self.conditions for measure in one.values]

    @property
    def moves(self) -> bool:
        """Whether some measure of the sum varies."""
        return not all(one.constant(measure) for one in self.conditions for measure in one.whole)

    def path(self, nights: Sequence[Night]) -> list[float]:
        """Return the evidence after each night of a series.

        Of a task's family, it is that of the sum over conditions. A method's takes half of its chance of a false alarm
        for the sum, and half for its measures, each of which is tested in two ways: if it varies in the committed
        trials, by ranks, else as a constant. A measure that pilots lack is in no sum, where all have the same trials.
        """
        if not self.of_method:
            return self._of_sum(nights).tolist() if self.moves else [1 / (at + 2) for at in range(len(nights))]
        paths = [self._of_sum(nights) / 2] if self.moves else []
        paths += [_of_column(one, measure, nights) / (4 * len(self.columns)) for one, measure in self.columns]
        return [float(largest) for largest in np.max(paths, axis=0)]

    def _of_sum(self, nights: Sequence[Night]) -> Floats:
        return _by_ranks(
            self.label, len(self.conditions[0].seeds), nights, lambda until: _scores(self.conditions, until)[0]
        )

    def nights_to_find(self, shift: float, each: int, level: float) -> int | None:
        """Return the median number of nights to an alarm if all its measures get better by `shift` SD.

        None if all of the sum are constant: then, against 110 committed trials, one night with
        another value in eight of thirty new ones is an alarm.
        """
        if not self.moves:
            return None
        scores, gain = _scores(self.conditions, ())
        moved = round(shift * gain / float(scores.std()), 1)
        return nights_to_find(len(self.conditions[0].seeds), each, moved, level * (2 if self.of_method else 1))


def families(conditions: Sequence[Watched]) -> tuple[Family, ...]:
    """Return the families of conditions: each method, and each task of several conditions that no method's are."""
    found: dict[tuple[str, ...], Family] = {}
    for of_method in (True, False):
        together: dict[tuple[str, tuple[int, ...]], list[Watched]] = {}
        for one in conditions:
            together.setdefault((one.names[0 if of_method else 1], one.seeds), []).append(one)
        for (name, _), those in together.items():
            label = name if of_method else f"task {name}"
            if sum(other == name for other, _ in together) > 1:
                label += f" ({', '.join(one.names[1 if of_method else 0] for one in those)})"
            if of_method or len(those) > 1:
                family = Family(label, tuple(those), of_method)
                found.setdefault(tuple(one.label for one in those), family)
    return tuple(found.values())


@dataclass(frozen=True)
class Watch:
    """What is watched at a tier."""

    tier: str
    conditions: tuple[Watched, ...]

    @cached_property
    def families(self) -> tuple[Family, ...]:
        """Its families."""
        return families(self.conditions)

    @property
    def level(self) -> float:
        """The evidence of a family that is an alarm."""
        return len(self.families) / ALPHA

    @cached_property
    def rules(self) -> str:
        """Hash of what evidence depends on besides the nights: it is the same within a series."""
        baselines = [[one.condition.id, one.label, one.seeds, dict(one.values)] for one in self.conditions]
        grouped = [[one.label, [each.label for each in one.conditions], one.of_method] for one in self.families]
        return content_hash([PROCESS, ALPHA, self.tier, baselines, grouped])

    def series(self, nights: Sequence[Night]) -> tuple[Night, ...]:
        """Return the nights that the next one goes on with: of the last series, if its rules still hold."""
        mine = [night for night in nights if night.tier == self.tier]
        last = mine[-1] if mine else None
        same = last is not None and last.rules == self.rules
        return tuple(night for night in mine if last and same and night.series == last.series)

    def first_fresh_seed(self, first: int, nights: Sequence[Night]) -> int:
        """Return the first seed, from `first` up, after all those of committed trials and of nights."""
        used = [*(one.seeds for one in self.conditions), *(night.seeds for night in nights)]
        return max([first, *(max(seeds) + 1 for seeds in used)])

    def alarms(self, nights: Sequence[Night]) -> dict[str, list[str]]:
        """Return the families whose evidence has reached the level in a series, with lines on each."""
        found = {}
        for one in self.families:
            reached = [night.evidence[one.label] >= self.level for night in nights]
            if True in reached:
                found[one.label] = _alarm(one, nights, reached.index(True))
        return found


def _alarm(family: Family, nights: Sequence[Night], at: int) -> list[str]:
    """Return lines on an alarm of the night at an index: when, what moved, which versions and devices are others."""
    path = [0.0, *(night.evidence[family.label] for night in nights[: at + 1])]
    quiet = max(index for index, found in enumerate(path) if found < 1)  # nights before the evidence grew
    lines = [f"ALARM on {nights[at].date}, night {at + 1}: {family.label}: evidence {path[-1]:.3g}"]
    lines += [f"  moved: {text}" for text in _moved(family, nights[quiet:])]
    changed = []
    for name in sorted({name for one in family.conditions for name in one.condition.packages}):
        committed = next((one.versions[name] for one in family.conditions if one.versions.get(name)), None)
        changed += _changed(name, committed, [night.versions.get(name) for night in nights[: at + 1]])
    lines.append(f"  versions against the committed trials: {', '.join(changed) or 'the same'}")
    devices = ", ".join(sorted({kind for one in family.conditions for kind in one.devices}))
    return [*lines, *_changed("  device", devices, [night.device for night in nights[: at + 1]])]


def _changed(name: str, committed: str | None, nights: Sequence[str | None]) -> list[str]:
    """Return what has changed by the last night, and since when; nothing if it is as it was."""
    if nights[-1] == committed:
        return []
    since = max((index for index, one in enumerate(nights, start=1) if one != nights[-1]), default=0)
    return [f"{name} {committed or 'none'} -> {nights[-1] or 'none'} since night {since + 1}"]


def _moved(family: Family, nights: Sequence[Night]) -> list[str]:
    """Return in words which measures differ most from the committed trials since the evidence grew."""
    found = []
    for one, measure in family.columns:
        was, new = one.values[measure], [value for night in nights for value in night.values[one.label][measure]]
        ranks = _ranks((*was, *new))
        effect = a12(ranks[len(was) :].tolist(), ranks[: len(was)].tolist())
        way = "higher" if effect > 0.5 else "lower"
        says = f"{one.label}: {measure} is {way}: median {median(was):.6g} -> {median(new):.6g}, A12 = {effect:.2f}"
        # Standardized by the spread of A12 where nothing moved.
        found.append((abs(effect - 0.5) / math.sqrt((1 / len(was) + 1 / len(new)) / 12), says))
    found.sort(key=lambda item: -item[0])
    return [says for size, says in found[:MOST_MOVED] if size > min(SHOWN, found[0][0] / 2)]


def _scores(conditions: Sequence[Watched], nights: Sequence[Night]) -> tuple[Floats, float]:
    """Return a score for each seed, shape [seeds]: the sum over conditions of the mean rank of their measures.

    Conditions are added up seed by seed, since trials of one seed may depend on each other. All seeds are treated
    alike. The second number is by how much a score grows if each measure gets better by a standard deviation.
    """
    total, gain = np.zeros(len(conditions[0].seeds) + sum(len(night.seeds) for night in nights)), 0.0
    for one in conditions:
        ranks = np.stack([standardized_ranks(_ranks(_column(one, name, nights))) for name in one.whole])
        ranks *= np.array([-1.0 if name in LOWER else 1.0 for name in one.whole])[:, None]
        mean = ranks.mean(axis=0)
        if (spread := float(mean.std())) > 0:
            total += mean / spread
            gain += float(np.mean(np.any(ranks, axis=1))) / spread
    return total, gain


def _of_column(one: Watched, measure: str, nights: Sequence[Night]) -> Floats:
    if not one.constant(measure):
        name = f"{one.label}: {measure}"
        return _by_ranks(name, len(one.values[measure]), nights, lambda until: _ranks(_column(one, measure, until)))
    first = one.values[measure][0]
    rows = [np.asarray(night.values[one.label][measure]) for night in nights]
    odd = [(int(_differ(row, first).sum()), len(row)) for row in rows]
    return np.array(evidence_against_constant(len(one.values[measure]), odd))


def _by_ranks(name: str, before: int, nights: Sequence[Night], scores: Callable[[Sequence[Night]], Floats]) -> Floats:
    """Return the evidence after each night, from scores of all trials up to it."""
    parts = [
        ranks_of_new(scores(nights[: at + 1]), np.array([uniform(name, seed) for seed in night.seeds]))
        for at, night in enumerate(nights)
    ]
    return evidence(np.concatenate(parts), before, [len(night.seeds) for night in nights])


def _column(one: Watched, measure: str, nights: Sequence[Night]) -> list[float]:
    return [*one.values[measure], *(value for night in nights for value in night.values[one.label][measure])]


def _ranks(values: Sequence[float]) -> Floats:
    """Return whole numbers in the order of the values, equal for those that float32 might round to each other."""
    order = np.argsort(values, kind="stable")
    ordered = np.asarray(values, np.float64)[order]
    ranks = np.empty(len(ordered))
    ranks[order] = np.concatenate([[0], np.cumsum(_differ(ordered[1:], ordered[:-1]))])
    return ranks


def _differ(values: Floats, others: Floats | float) -> NDArray[np.bool_]:
    """Return where numbers differ by more than rounding in float32."""
    with np.errstate(invalid="ignore"):  # inf - inf
        near = np.abs(values - others) <= RESOLUTION * np.maximum(np.abs(values), np.abs(others))
    return np.where(np.isfinite(values) & np.isfinite(others), ~near, values != others)
