"""Curves over training: few points, one line a trial or quantiles, gaps where a value is no number."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from laboratory import CONDITIONS, Laboratory, record

from evoclaims.judging.exact import MAX_TRIALS
from evoclaims.report.training_curves import CurvePanel, panels
from evoclaims.report.trial_summary import POINTS, Reader, TrialSummary


@pytest.fixture
def read(tmp_path: Path) -> Any:
    """A function that stores one trial for each set of curves, each time afresh, and looks at them."""
    times = itertools.count()

    def look(*curves: dict[str, Any]) -> tuple[TrialSummary, ...]:
        lab = Laboratory(tmp_path / str(next(times)))
        made = [record(CONDITIONS["better", "small"], seed, 1.0, curves=one) for seed, one in enumerate(curves)]
        for trial in made:
            lab.store.put(trial, {})
        return Reader(lab.archive).read([trial.id for trial in made])

    return look


def _curve(values: Any) -> dict[str, Any]:
    values = tuple(map(float, values))
    return {"environment_steps": tuple(10.0 * (i + 1) for i in range(len(values))), "gain": values}


def _only(found: tuple[tuple[CurvePanel, ...], str]) -> CurvePanel:
    ((panel,), _) = found
    return panel


def test_long_curves_keep_their_ends_and_at_most_a_hundred_points(read: Any) -> None:
    trials = read(_curve(range(1234)))
    assert trials[0].reports == 1234
    line = _only(panels(trials)).lines[0]
    assert len(line.y) == POINTS == 100
    assert (line.y[0], line.y[-1], line.x[-1]) == (0.0, 1233.0, 12340.0)
    assert panels(trials)[1] == "At most 100 of 1234 reports are drawn."
    assert len(read(_curve(range(7)))[0].curves["gain"]) == 7


def test_each_trial_has_a_line_with_gaps_where_values_are_no_numbers(read: Any) -> None:
    lines = _only(panels(read(*(_curve([0, i, i]) for i in range(MAX_TRIALS))))).lines
    assert [(line.label, line.y[-1]) for line in lines] == [(f"seed {i}", i) for i in range(MAX_TRIALS)]
    nan = float("nan")
    panel = _only(panels(read(_curve([0, nan, 2]), _curve([1, 1, float("inf")]), _curve([0, 1, 2]))))
    assert panel.broken == 2
    assert np.isnan(panel.lines[0].y[1])


def test_what_never_changes_is_said_and_not_drawn(read: Any) -> None:
    trials = read(*({**_curve([0, i]), "level": (2.0, 2.0)} for i in (1, 2)))
    found, says = panels(trials)
    assert [panel.name for panel in found] == ["gain"]
    assert says == "Level is 2 throughout training."


def test_trials_with_one_point_or_a_broken_axis_have_no_curve(read: Any) -> None:
    broken = {"environment_steps": (1.0, float("nan")), "gain": (0.0, 1.0)}
    found, says = panels(read(_curve([1]), broken))
    assert (found, says) == ((), "No trial has a curve of more than one point.")
    assert panels(()) == ((), "")
    assert panels(read(_curve([0, 1]), _curve([1])))[1] == "1 of 2 trials have at most one point."
