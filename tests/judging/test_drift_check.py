"""Drift: new trials against at least ten references of the same condition, corrected over the suite."""

from __future__ import annotations

import json
import math

import pytest

from evoclaims.judging.drift import DriftCase, check_drift

BEFORE = [0.50, 0.52, 0.54, 0.56, 0.58, 0.60, 0.62, 0.64, 0.66, 0.68]


@pytest.fixture
def case(trial):
    """Return the factory of cases of the condition "c"; references take the seeds from 100."""

    def make(new, reference=BEFORE, of="c", metrics=("score",), label="ppo on n_parity"):  # type: ignore[no-untyped-def]
        return DriftCase(
            label,
            "c",
            tuple(trial(seed, value, "c") for seed, value in enumerate(new)),
            tuple(trial(100 + seed, value, of) for seed, value in enumerate(reference)),
            metrics,
        )

    return make


def test_trials_like_the_references_have_not_drifted(case) -> None:
    (row,) = check_drift([case([0.51, 0.55, 0.59, 0.63, 0.67])]).rows
    assert (row.status, row.drifted, row.n_new, row.n_ref) == ("no drift", False, 5, 10)
    assert row.p is not None
    assert row.p > 0.5


@pytest.mark.parametrize("level", [0.1, 0.9])
def test_a_shift_in_either_direction_is_drift(case, level: float) -> None:
    report = check_drift([case([level] * 5)])
    assert report.rows[0].p == pytest.approx(2 / math.comb(15, 5))
    assert report.rows[0].drifted
    assert report.drifted


def test_trials_that_now_diverge_are_drift(case) -> None:
    assert check_drift([case(["diverged"] * 5)]).drifted


def test_the_suite_pays_holms_correction(case) -> None:
    drifting, steady = case([0.9] * 5), case([0.51, 0.55, 0.59, 0.63, 0.67])
    few, many = check_drift([drifting] + [steady] * 4), check_drift([drifting] + [steady] * 15)
    assert few.rows[0].p_holm == pytest.approx(5 * 2 / math.comb(15, 5))
    assert [row.drifted for row in few.rows] == [True, False, False, False, False]
    assert few.drifted
    assert not many.drifted
    assert {row.status for row in many.rows} == {"underpowered"}


def test_fewer_than_ten_references_are_said_and_no_pass(case) -> None:
    report = check_drift([case([0.5] * 5, BEFORE[:9])])
    (row,) = report.rows
    assert (row.status, row.p, row.p_holm) == ("no reference", None, None)
    assert "9 reference trials of this condition, 10 needed" in row.detail
    assert report.unchecked == report.rows


def test_references_of_another_fingerprint_are_left_out_visibly(case) -> None:
    (row,) = check_drift([case([0.5] * 5, of="older code")]).rows
    assert (row.status, row.n_ref) == ("no reference", 0)
    assert "10 of another fingerprint left out" in row.detail


def test_too_few_new_trials_are_underpowered_rather_than_a_pass(case) -> None:
    report = check_drift([case([0.51, 0.55])])
    assert report.rows[0].status == "underpowered"
    assert report.unchecked == report.rows


def test_without_new_trials_nothing_was_run(case) -> None:
    assert check_drift([case([])]).rows[0].status == "not run"


@pytest.mark.parametrize(
    ("new", "metric", "detail"),
    [
        ([0.5, "crashed"], "score", "crashed: seeds 1"),
        ([0.5, math.nan], "score", "NaN"),
        ([0.5, 0.6], "scroe", "no metric 'scroe'"),
    ],
)
def test_a_metric_that_cannot_be_read_is_an_error_row_beside_the_others(case, new, metric, detail) -> None:
    report = check_drift([case(new, metrics=(metric,)), case([0.9] * 5)])
    assert report.rows[0].status == "error"
    assert detail in report.rows[0].detail
    assert report.rows[1].drifted


def test_the_report_is_strict_json(case) -> None:
    plain = json.loads(json.dumps(check_drift([case(["diverged"] * 5)]).to_json(), allow_nan=False))
    assert plain["alpha"] == 0.01
    assert plain["rows"][0]["status"] == "drift"


def test_a_difference_that_single_precision_cannot_hold_is_no_drift(case) -> None:
    """The same success, 37.83 of 42 rows, as two releases round its mean: every new value is a little above."""
    before, now = 0.90079361, 0.90079367
    (row,) = check_drift([case([now] * 9 + [0.925], [before] * 9 + [0.859])]).rows
    assert row.status == "no drift"
    assert row.a12 == pytest.approx(0.595)  # 19 of 100 pairs are above, and 81 ties
    assert row.median_new == row.median_ref


def test_a_value_without_limit_is_not_taken_for_the_largest_finite_one(case) -> None:
    (row,) = check_drift([case([math.inf] * 5, [1.0, 2.0] * 5)]).rows
    assert (row.status, row.median_new, row.median_ref) == ("drift", math.inf, 1.5)


def test_values_that_single_precision_tells_apart_are_told_apart(case) -> None:
    assert check_drift([case([0.9008] * 5, [0.9007] * 10)]).drifted
