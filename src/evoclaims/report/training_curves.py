"""Curves in panels: of trials over training, one for each quantity, and of evidence over nights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evoclaims.report.formatting import clean, number, plural
from evoclaims.report.trial_summary import AXES, POINTS, TrialSummary
from evoclaims.verdicts.watch_file import Night, standing

FIRST: Final = ("success", "fitness", "level")
"""Curves that every method has; they come first."""

MOST_PANELS: Final = 8


@dataclass(frozen=True, eq=False)
class Line:
    """One trial's curve.

    Attributes:
        label: such as "seed 3".
        x, y: shape [points]; y may hold NaN.
    """

    label: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CurvePanel:
    """One quantity over training.

    Attributes:
        name: of the quantity.
        lines: one per trial.
        broken: how many curves hold a value that is not finite, which leaves a gap.
    """

    name: str
    lines: tuple[Line, ...]
    broken: int


def panels(trials: Sequence[TrialSummary]) -> tuple[tuple[CurvePanel, ...], str]:
    """Return the panels of a condition's trials, and in words what is not drawn."""
    usable = [trial for trial in trials if trial.reports > 1 and trial.curves]
    if not usable:
        return (), "No trial has a curve of more than one point." if trials else ""
    names = set.intersection(*(set(trial.curves) for trial in usable)) - set(AXES)
    names = {name for name in names if any(trial.curves[name].reported for trial in usable)}  # of others was no number
    ordered = [name for name in FIRST if name in names] + sorted(names - set(FIRST))
    constant = {name: value for name in ordered if (value := _constant(usable, name)) is not None}
    varying = [name for name in ordered if name not in constant]
    notes = [f"{clean(name)} is {number(value)} throughout training" for name, value in constant.items()]
    if len(usable) < len(trials):
        notes.append(f"{len(trials) - len(usable)} of {len(trials)} trials have at most one point")
    if varying[MOST_PANELS:]:
        notes.append(f"not drawn: {', '.join(map(clean, varying[MOST_PANELS:]))}")
    drawn = varying[:MOST_PANELS]
    longest = max((trial.curves[name].reported for trial in usable for name in drawn), default=0)
    if longest > POINTS:
        notes.append(f"at most {POINTS} of {longest} reports are drawn")
    text = "; ".join(notes)
    return tuple(_panel(usable, name) for name in drawn), text[:1].upper() + text[1:] + "." * bool(text)


def _constant(trials: Sequence[TrialSummary], name: str) -> float | None:
    """Return the value that a quantity has in all trials at all times; None when it changes."""
    values = [value for trial in trials if (value := trial.curves[name].constant) is not None]
    same = len(values) == len(trials) and np.array_equal(values, values[:1] * len(values), equal_nan=True)
    return values[0] if same else None


def _panel(trials: Sequence[TrialSummary], name: str) -> CurvePanel:
    broken = sum(not np.isfinite(trial.curves[name].y).all() for trial in trials)
    lines = tuple(Line(f"seed {t.seed_in_words}", t.curves[name].x, t.curves[name].y) for t in trials)
    return CurvePanel(clean(name), lines, broken)


@dataclass(frozen=True, eq=False)
class WatchShown:
    """The last series of nights at a tier.

    Attributes:
        tier: whose conditions ran.
        says: how many nights, and the largest evidence, in a sentence.
        panel: the logarithm to base 10 of each family's evidence, and of the level of an alarm.
    """

    tier: str
    says: str
    panel: CurvePanel


def by_night(nights: Sequence[Night]) -> tuple[WatchShown, ...]:
    """Return the last series of each tier."""
    return tuple(
        _last_series([night for night in nights if night.tier == tier]) for tier in sorted({one.tier for one in nights})
    )


def _last_series(every: Sequence[Night]) -> WatchShown:
    """Return the last series of a tier, which has at least one night."""
    last = every[-1]
    nights = [night for night in every if night.series == last.series]
    x = np.arange(len(nights) + 1.0)
    paths = {name: [1.0, *(night.evidence[name] for night in nights)] for name in last.evidence}
    lines = [Line(name, x, np.log10(path)) for name, path in paths.items()]
    alarm = Line(f"alarm at {last.level:g}", x, np.full(len(x), np.log10(last.level)))
    name = max(last.evidence, key=last.evidence.__getitem__)
    alarms = sorted(name for name, path in paths.items() if max(path) >= last.level)
    says = (
        f"{plural(len(nights), 'night')} up to {last.date}, alarm at an evidence of {last.level:g}. Largest on the "
        f"last night: {name} with {last.evidence[name]:.2g}. Alarms: {', '.join(alarms) or 'none'}."
    )
    says = " ".join([says, *standing(every)])
    return WatchShown(last.tier, says, CurvePanel(f"log10 of evidence ({last.tier})", (*lines, alarm), 0))
