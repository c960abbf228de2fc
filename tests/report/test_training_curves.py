"""Curves over training: few points, one line a trial or quantiles, gaps where a value is no number."""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from laboratory import CONDITIONS, HERE, Laboratory, record

from evoclaims.judging.exact import MAX_TRIALS
from evoclaims.report.charts import curves_svg
from evoclaims.report.training_curves import CurvePanel, panels
from evoclaims.report.trial_summary import POINTS, Reader, TrialSummary
from evoclaims.trials.imported import Imported
from evoclaims.trials.result import TRAINED_BY


@pytest.fixture
def read(tmp_path: Path) -> Any:
    """A function that stores one trial for each set of curves, each time afresh, and looks at them."""
    times = itertools.count()

    def look(*curves: dict[str, Any], **more: Any) -> tuple[TrialSummary, ...]:
        lab = Laboratory(tmp_path / str(next(times)))
        made = [record(CONDITIONS["better", "small"], seed, 1.0, curves=one, **more) for seed, one in enumerate(curves)]
        for trial in made:
            lab.store.put(trial, {})
        return Reader(lab.archive).read([trial.id for trial in made])

    return look


@pytest.fixture
def table(tmp_path: Path) -> Any:
    """A function that stores the trials of a table with the columns seed, step, loss and return, and looks at them."""

    def look(*rows: tuple[object, ...], **settings: Any) -> tuple[TrialSummary, ...]:
        text = "".join(",".join(map(str, row)) + "\n" for row in [("seed", "step", "loss", "return"), *rows])
        (tmp_path / "runs.csv").write_text(text)
        made = Imported("runs.csv", "seed", ["loss", "return"], step="step", folder=tmp_path, **settings).existing
        lab = Laboratory(tmp_path)
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
    assert len(read(_curve(range(7)))[0].curves["gain"].y) == 7


def test_each_trial_has_a_line_with_gaps_where_values_are_no_numbers(read: Any) -> None:
    lines = _only(panels(read(*(_curve([0, i, i]) for i in range(MAX_TRIALS))))).lines
    assert [(line.label, line.y[-1]) for line in lines] == [(f"seed {i}", i) for i in range(MAX_TRIALS)]
    nan = float("nan")
    panel = _only(panels(read(_curve([0, nan, 2]), _curve([1, 1, float("inf")]), _curve([0, 1, 2]))))
    assert panel.broken == 2
    assert np.isnan(panel.lines[0].y[1])


def test_each_curve_of_a_table_is_thinned_among_its_own_numbers(table: Any) -> None:
    """One metric is logged in each row, another in each tenth, which rows chosen beforehand would miss."""
    rows = [(s, 100 * i, 1 / (s + i), s + i if i % 10 == 5 else "") for s in (1, 2) for i in range(991)]
    (loss, earned), says = panels(table(*rows))
    assert says == "At most 100 of 991 reports are drawn."
    assert [len(line.y) for line in (*loss.lines, *earned.lines)] == [100, 100, 99, 99]
    assert list(earned.lines[0].x) == [100 * i for i in range(5, 991, 10)]
    assert list(earned.lines[1].y) == [2 + i for i in range(5, 991, 10)]
    assert (earned.broken, earned.lines[0].label) == (0, "seed 0 (1 in the table)")


def test_what_a_table_has_logged_in_other_rows_is_joined(table: Any) -> None:
    found, says = panels(table(*((1, i, *((0.5, "") if i % 2 else ("", i))) for i in range(8))))
    assert [(panel.name, list(panel.lines[0].x), panel.broken) for panel in found] == [("return", [0, 2, 4, 6], 0)]
    assert says == "Loss is 0.5 throughout training."
    (path,) = re.findall('class="line" d="([^"]*)"', curves_svg(found[0], "return"))
    assert path.count("M") == path.count("l") == 1
    rows = [(1, 1, 1, 5), (1, 2, 2, "inf"), (1, 3, "", 5), (1, 4, 3, "nan"), (2, 1, 1, 4), (2, 2, 2, 5), (2, 3, 3, "")]
    loss, earned = panels(table(*rows))[0]
    assert (loss.broken, earned.broken) == (0, 1)
    assert np.isnan(earned.lines[0].y[-1])
    assert list(earned.lines[0].y[:3]) == [5, float("inf"), 5]
    assert list(earned.lines[1].y) == [4, 5]
    trials = table((1, 1, 1, ""), (1, 2, 2, ""), (2, 1, 1, ""), (2, 2, 2, ""), empty_means_diverged=True)
    assert panels(trials)[1] == "Return is NaN throughout training."


def test_what_a_loop_left_out_is_joined_unless_it_may_have_reported_nan(read: Any) -> None:
    curve = {**_curve([0, float("nan"), 2]), "gone": (0.0, 1.0, 2.0)}
    by_loop = {"provenance": {**HERE, TRAINED_BY: "our_loops:train"}}
    for more, broken in ((by_loop, 0), ({**by_loop, "status": "diverged"}, 1), ({}, 1)):
        gain, _ = panels(read(curve, **more))[0]
        assert (gain.broken, len(gain.lines[0].y)) == (broken, 2 + broken)


def test_gaps_and_changes_between_the_points_that_are_kept_are_seen(read: Any) -> None:
    values = np.zeros(1234)
    values[[5, 6, 700]] = float("nan")
    panel = _only(panels(read(_curve(values))))
    assert panel.broken == 1
    assert [int(x) for x in panel.lines[0].x[np.isnan(panel.lines[0].y)]] == [60, 7010]
    values = np.zeros(1234)
    values[5] = 1.0
    assert panels(read(_curve(values)))[1] == "At most 100 of 1234 reports are drawn."


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
