"""Training curves of a condition's trials, one panel for each quantity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from evoclaims.report.formatting import clean, number
from evoclaims.report.trial_summary import POINTS, TrialSummary

AXES: Final = ("environment_steps", "steps")
"""Curves that count the spent budget; the first is the panels' axis."""

FIRST: Final = ("success", "fitness", "level")
"""Curves that every method has; they come first."""

MOST_LINES: Final = 30
"""Most trials that are drawn one by one."""

MOST_PANELS: Final = 8


@dataclass(frozen=True, eq=False)
class Line:
    """One trial's curve, or a quantile over trials.

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
        lines: one per trial, or only the median over trials.
        band: lower and upper decile over trials; None where each trial has its line.
        broken: how many curves hold a value that is not finite, which leaves a gap.
    """

    name: str
    lines: tuple[Line, ...]
    band: tuple[Line, Line] | None
    broken: int


def panels(trials: Sequence[TrialSummary]) -> tuple[tuple[CurvePanel, ...], str]:
    """Return the panels of a condition's trials, and in words what is not drawn."""
    usable = [trial for trial in trials if trial.reports > 1 and np.isfinite(trial.curves.get(AXES[0], np.nan)).all()]
    if not usable:
        return (), "No trial has a curve of more than one point." if trials else ""
    names = set.intersection(*(set(trial.curves) for trial in usable)) - set(AXES)
    ordered = [name for name in FIRST if name in names] + sorted(names - set(FIRST))
    constant = {name: value for name in ordered if (value := _constant(usable, name)) is not None}
    varying = [name for name in ordered if name not in constant]
    notes = [f"{clean(name)} is {number(value)} throughout training" for name, value in constant.items()]
    if len(usable) < len(trials):
        notes.append(f"{len(trials) - len(usable)} of {len(trials)} trials have at most one point")
    if varying[MOST_PANELS:]:
        notes.append(f"not drawn: {', '.join(map(clean, varying[MOST_PANELS:]))}")
    longest = max(trial.reports for trial in usable)
    if longest > POINTS:
        notes.append(f"at most {POINTS} of {longest} reports are drawn")
    text = "; ".join(notes)
    return tuple(_panel(usable, name) for name in varying[:MOST_PANELS]), text[:1].upper() + text[1:] + "." * bool(text)


def _constant(trials: Sequence[TrialSummary], name: str) -> float | None:
    """Return the value that a quantity has in all trials at all times; None when it changes."""
    first = trials[0].curves[name][0]
    same = all(np.array_equal(t.curves[name], np.full_like(t.curves[name], first), equal_nan=True) for t in trials)
    return float(first) if same else None


def _panel(trials: Sequence[TrialSummary], name: str) -> CurvePanel:
    broken = sum(not np.isfinite(trial.curves[name]).all() for trial in trials)
    if len(trials) <= MOST_LINES:
        lines = tuple(Line(f"seed {t.seed}", t.curves[AXES[0]], t.curves[name]) for t in trials)
        return CurvePanel(clean(name), lines, None, broken)
    ends = [trial.curves[AXES[0]] for trial in trials]
    x = np.unique(np.linspace(min(axis[0] for axis in ends), max(axis[-1] for axis in ends), POINTS))
    held = pd.DataFrame([_held(trial, name, x) for trial in trials])
    low, middle, high = held.quantile([0.1, 0.5, 0.9]).to_numpy()  # of the finite values; NaN where there are none
    count = len(trials)
    return CurvePanel(
        clean(name),
        (Line(f"median of {count} trials", x, middle),),
        (Line("lower decile", x, low), Line("upper decile", x, high)),
        broken,
    )


def _held(trial: TrialSummary, name: str, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a curve at other positions: each value holds until the next, the last forever; NaN before the first."""
    places = np.searchsorted(trial.curves[AXES[0]], x, side="right") - 1
    held = np.where(places >= 0, trial.curves[name][np.maximum(places, 0)], np.nan)
    return np.where(np.isfinite(held), held, np.nan)
