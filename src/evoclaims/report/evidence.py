"""A verdict's evidence laid out for readers: each part of the assertion with its numbers and its trials as dots."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median

from evoclaims.judging.effect import iqm, iqm_interval
from evoclaims.judging.sample import Sample
from evoclaims.judging.verdict import Bound, Direction, Evidence, Interval, Outcome, Verdict
from evoclaims.report.formatting import clean, number, p_value
from evoclaims.report.trial_summary import TrialSummary


@dataclass(frozen=True)
class Dot:
    """A trial's value."""

    seed: int
    value: float


@dataclass(frozen=True)
class Strip:
    """What was read from the trials of one condition.

    Attributes:
        label: such as "cma_es on n_parity: mean success".
        dots: trials with a finite value.
        apart: trials without one, as (seed, why): "diverged", "NaN".
        median: of all values that the judge used; None if there are none.
        least: what the median is at least, where values beyond a limit are not observed and it is one of them.
        known_as: the seeds in words, by seed; those that are the number alone may be left out.
    """

    label: str
    dots: tuple[Dot, ...]
    apart: tuple[tuple[int, str], ...]
    median: float | None
    least: float | None = None
    known_as: Mapping[int, str] = field(default_factory=dict)

    def seed_in_words(self, seed: int) -> str:
        """Return the seed of a trial as its reader finds it, such as "0 (1 in the table)"."""
        return self.known_as.get(seed, str(seed))

    @property
    def texts(self) -> tuple[tuple[int, str], ...]:
        """Every trial's seed, and its value as text."""
        return (*((dot.seed, number(dot.value)) for dot in self.dots), *self.apart)

    @property
    def n(self) -> int:
        """Number of trials."""
        return len(self.dots) + len(self.apart)

    @property
    def middle(self) -> str:
        """The median as text."""
        return number(self.median) if self.least is None else f"> {number(self.least)}"


@dataclass(frozen=True)
class Part:
    """One part of an assertion, or trials without a verdict.

    Attributes:
        describe: the assertion in plain English.
        outcome: what this part says by itself; None without a verdict.
        numbers: names and values for a table.
        detail: what else is known.
        event: whether values are 1 (something held) or 0 (it did not).
        strips: the trials.
        bounds: what the assertion compares with, on the strips' axis.
        spans: intervals on the strips' axis.
        decided: whether the verdict rests on this one of several parts.
    """

    describe: str
    outcome: Outcome | None
    numbers: tuple[tuple[str, str], ...]
    detail: str
    event: bool
    strips: tuple[Strip, ...]
    bounds: tuple[Bound, ...] = ()
    spans: tuple[Interval, ...] = ()
    decided: bool = False

    @property
    def rows(self) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """Every trial's value as text, one column per strip, and one row per seed with what each table calls it."""
        columns = [{(seed, strip.seed_in_words(seed)): text for seed, text in strip.texts} for strip in self.strips]
        seeds = sorted({seed for column in columns for seed in column})
        return tuple((seed[1], tuple(column.get(seed, "–") for column in columns)) for seed in seeds)


def judged_parts(verdict: Verdict) -> tuple[Part, ...]:
    """Return the parts of a verdict as they are shown."""
    return tuple(
        Part(
            describe=evidence.describe,
            outcome=evidence.outcome,
            numbers=_numbers(evidence),
            detail=evidence.detail,
            event=evidence.events,
            strips=tuple(_strip(sample) for sample in evidence.samples),
            bounds=tuple(bound for bound in evidence.bounds if bound.on_axis),
            spans=tuple(interval for interval in evidence.intervals if interval.on_axis),
            decided=index == verdict.deciding and len(verdict.evidence) > 1,
        )
        for index, evidence in enumerate(verdict.evidence)
    )


def in_short(labels: Sequence[str]) -> list[str]:
    """Return the conditions of labels such as "cma_es on n_parity: reward" if they tell them apart, else the labels."""
    conditions = [label.partition(":")[0] for label in labels]
    return conditions if len(set(conditions)) == len(conditions) else list(labels)


def unjudged_part(label: str, trials: Sequence[TrialSummary]) -> Part:
    """Return the mean success of trials without a verdict, so that a reader sees which of them are broken."""
    dots = tuple(Dot(t.seed, t.score) for t in trials if t.score is not None and math.isfinite(t.score))
    shown = {dot.seed for dot in dots}
    apart = tuple((t.seed, _why(t)) for t in trials if t.seed not in shown)
    middle = median(dot.value for dot in dots) if dots else None
    known_as = {t.seed: clean(t.seed_in_words) for t in trials}
    strip = Strip(clean(f"{label}: mean success over levels"), dots, apart, middle, known_as=known_as)
    return Part("the trials at hand, not judged", None, (), "", False, (strip,))


def _why(trial: TrialSummary) -> str:
    """Say why a trial has no finite score."""
    if trial.status != "done":
        return trial.status
    return "no mean success" if trial.score is None else number(trial.score)


def _strip(sample: Sample) -> Strip:
    """Return a sample with failed trials, and those beyond a limit, set apart."""
    failed = dict(zip(sample.failed, sample.endings, strict=True))
    pairs = list(zip(sample.seeds, sample.values, strict=True))
    dots = tuple(Dot(seed, value) for seed, value in pairs if seed not in failed and math.isfinite(value))
    shown = {dot.seed for dot in dots}
    beyond = "" if sample.limit is None else f"> {number(sample.limit)}"
    apart = tuple((seed, failed.get(seed, beyond or number(value))) for seed, value in pairs if seed not in shown)
    known_as = dict(zip(sample.seeds, map(clean, sample.known_as), strict=bool(sample.known_as)))
    return Strip(clean(sample.label), dots, apart, sample.median, _least(sample, median), known_as)


def _least(sample: Sample, statistic: Callable[[Sequence[float]], float]) -> float | None:
    """Return what a statistic is at least, where values beyond a limit make it infinite; else None."""
    return statistic(sample.capped) if sample.limit is not None and math.isinf(statistic(sample.values)) else None


def _iqm(sample: Sample) -> str:
    """Return the interquartile mean of a sample, and its interval, as rliable has them: description only."""
    least = _least(sample, iqm)
    mean = number(iqm(sample.values)) if least is None else f"> {number(least)}"
    low, high = map(number, iqm_interval(sample.capped))
    ends = f"95% stratified bootstrap {low} to {high}"
    limited = "" if sample.limit is None else f", nothing beyond {number(sample.limit)}"
    return f"{mean} ({ends}{limited})"


def _numbers(evidence: Evidence) -> tuple[tuple[str, str], ...]:
    """Return what was computed, the p that decided first, without what its kind lacks."""
    tests = [
        ("p for", evidence.p, evidence.attainable_p),
        ("p against", evidence.p_refuted, evidence.attainable_p_refuted),
        ("p against its size", evidence.p_smaller, evidence.attainable_p_smaller),
    ]
    first = list(Direction).index(evidence.direction)
    tests.insert(0, tests.pop(first))
    samples = () if evidence.events else evidence.samples
    names = in_short([clean(sample.label) for sample in samples])
    effects = (("A12", evidence.a12), ("Cliff’s δ", evidence.cliffs_delta))
    return (
        ("n a side", str(evidence.n)),
        ("α", f"{evidence.alpha:g}"),
        *((name, f"{p_value(p)} (smallest attainable {p_value(least)})") for name, p, least in tests if p is not None),
        *((name, number(value)) for name, value in effects if value is not None),
        *((interval.of, f"{number(interval.low)} to {number(interval.high)}") for interval in evidence.intervals),
        *((bound.name, number(bound.value)) for bound in evidence.bounds if not bound.on_axis),
        *((f"IQM of {name}", _iqm(sample)) for name, sample in zip(names, samples, strict=True)),
    )
