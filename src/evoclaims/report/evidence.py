"""A verdict's evidence as it is shown: each part of the assertion with its numbers and its trials as dots."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, Final

from evoclaims.judging.verdict import Outcome
from evoclaims.report.formatting import clean, number
from evoclaims.report.trial_summary import Glance

EVENT_KINDS: Final = frozenset({"solves", "stays", "exact"})
"""Kinds whose samples say whether something held: 1 or 0."""

MOST_ROWS: Final = 50
"""Most trials whose values are written out."""

Statuses = Mapping[str, Mapping[int, str]]
"""How trials ended, by the condition's label and the seed."""

_BAND: Final = re.compile(r"lies in \[(\S+), (\S+)\]$")
_P0: Final = re.compile(r"against p0 = (\S+)$")


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
        median: of all values that the judge saw; None where it saw none.
    """

    label: str
    dots: tuple[Dot, ...]
    apart: tuple[tuple[int, str], ...]
    median: float | None

    @property
    def n(self) -> int:
        """Number of trials."""
        return len(self.dots) + len(self.apart)


@dataclass(frozen=True)
class Span:
    """An interval that describes; `of` says what it covers."""

    of: str
    low: float
    high: float


@dataclass(frozen=True)
class Part:
    """One part of an assertion, or trials that no verdict came of.

    Attributes:
        describe: the assertion in plain English.
        outcome: what this part says by itself; None without a verdict.
        numbers: names and values for a table.
        detail: what else is known.
        event: whether values say that something held (1) or did not (0).
        strips: the trials.
        bounds: what the assertion compares with: names and values on the strips' axis.
        spans: intervals on the strips' axis.
    """

    describe: str
    outcome: Outcome | None
    numbers: tuple[tuple[str, str], ...]
    detail: str
    event: bool
    strips: tuple[Strip, ...]
    bounds: tuple[tuple[str, float], ...] = ()
    spans: tuple[Span, ...] = ()

    @property
    def rows(self) -> tuple[tuple[int, tuple[str, ...]], ...]:
        """Every trial's value as text, one row a seed and one column a strip; none where a table would be too long."""
        columns = [
            {**{dot.seed: number(dot.value) for dot in strip.dots}, **dict(strip.apart)} for strip in self.strips
        ]
        seeds = sorted({seed for column in columns for seed in column})
        if len(seeds) > MOST_ROWS:
            return ()
        return tuple((seed, tuple(column.get(seed, "–") for column in columns)) for seed in seeds)


def judged_part(evidence: Mapping[str, Any], statuses: Statuses) -> Part:
    """Return a part of a verdict, from its JSON.

    Args:
        evidence: as in `Verdict.to_json`.
        statuses: how trials ended, by condition's label and seed.
    """
    event = evidence["kind"] in EVENT_KINDS
    spans = tuple(Span(clean(one["of"]), float(one["low"]), float(one["high"])) for one in evidence["intervals"])
    return Part(
        describe=clean(evidence["describe"]),
        outcome=Outcome(evidence["outcome"]),
        numbers=_numbers(evidence, spans),
        detail=clean(evidence["detail"]),
        event=event,
        strips=tuple(_strip(sample, statuses) for sample in evidence["samples"]),
        bounds=_bounds(evidence),
        spans=tuple(span for span in spans if event or span.of.startswith("median")),
    )


def unjudged_part(label: str, trials: Sequence[Glance]) -> Part:
    """Return the mean success of trials that no verdict came of, so that a reader sees which of them is broken."""
    dots = tuple(Dot(t.seed, t.score) for t in trials if t.score is not None and math.isfinite(t.score))
    shown = {dot.seed for dot in dots}
    apart = tuple((t.seed, _why(t)) for t in trials if t.seed not in shown)
    middle = median(dot.value for dot in dots) if dots else None
    strip = Strip(f"{label}: mean success over levels", dots, apart, middle)
    return Part("the trials at hand, not judged", None, (), "", False, (strip,))


def _why(trial: Glance) -> str:
    """Say why a trial has no finite score."""
    if trial.status != "done":
        return trial.status
    return "no mean success" if trial.score is None else number(trial.score)


def _strip(sample: Mapping[str, Any], statuses: Statuses) -> Strip:
    """Return a sample with failed trials set apart."""
    ended = statuses.get(sample["label"].partition(": ")[0], {})
    failed, values = set(sample["failed"]), [float(value) for value in sample["values"]]
    pairs = list(zip(sample["seeds"], values, strict=True))
    return Strip(
        label=clean(sample["label"]),
        dots=tuple(Dot(seed, value) for seed, value in pairs if seed not in failed and math.isfinite(value)),
        apart=tuple(
            (seed, ended.get(seed, "failed") if seed in failed else number(value))
            for seed, value in pairs
            if seed in failed or not math.isfinite(value)
        ),
        median=float(sample["median"]),
    )


def _numbers(evidence: Mapping[str, Any], spans: Sequence[Span]) -> tuple[tuple[str, str], ...]:
    """Return what was computed, without what the kind does not have."""
    shown = [
        ("n a side", str(evidence["n"])),
        ("α", f"{evidence['alpha']:g}"),
        *(
            (name, f"{evidence[key]:.2g} (smallest attainable {evidence[least]:.2g})")
            for name, key, least in (
                ("p for", "p", "attainable_p"),
                ("p against", "p_refuted", "attainable_p_refuted"),
            )
            if evidence[key] is not None
        ),
        *(
            (name, number(float(evidence[key])))
            for name, key in (("A12", "a12"), ("Cliff’s δ", "cliffs_delta"))
            if evidence[key] is not None
        ),
        *((span.of, f"{number(span.low)} to {number(span.high)}") for span in spans),
    ]
    return tuple(shown)


def _bounds(evidence: Mapping[str, Any]) -> tuple[tuple[str, float], ...]:
    """Return what the assertion's own sentences say that values are compared with."""
    if (band := _BAND.search(evidence["describe"])) is not None:
        return ("lowest", float(band[1])), ("highest", float(band[2]))
    if (null := _P0.search(evidence["detail"])) is not None:
        return (("p0", float(null[1])),)
    return ()
